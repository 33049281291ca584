"""The benchmark: a fixed set of brakings, scored against their causal optima (docs/benchmark.md)."""
from .cases import VERSION, Case, drawn, whole_set
from .score import Entry, Result, Score, run

__all__ = ['Case', 'Entry', 'Result', 'Score', 'VERSION', 'drawn', 'run', 'whole_set']
