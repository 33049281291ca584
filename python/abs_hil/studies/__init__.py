"""Studies: many simulated runs that a file describes, and what they show (docs/studies.md)."""
from .results import StudyResults, load_study
from .running import simulate_run, study

__all__ = ['StudyResults', 'load_study', 'simulate_run', 'study']
