"""Identification of a rig's parameters from its own logs (docs/identification.md)."""
from .estimate import identify
from .found import Estimate, Identified
from .logs import Log, load_log

__all__ = ['Estimate', 'Identified', 'Log', 'identify', 'load_log']
