"""Identification of a rig's parameters from its own logs, or from coarse traces of its speeds (docs/identification.md)."""
from .estimate import identify
from .found import Estimate, Identified
from .logs import Log, load_log
from .speeds import SpeedsFound, identify_speeds
from .traces import Trace, load_trace

__all__ = ['Estimate', 'Identified', 'Log', 'SpeedsFound', 'Trace', 'identify', 'identify_speeds', 'load_log', 'load_trace']
