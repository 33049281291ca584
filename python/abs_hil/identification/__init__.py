"""Identification of a rig's parameters from its own logs (docs/identification.md)."""
from .estimate import Estimate, Identified, identify
from .logs import Log, load_log

__all__ = ['Estimate', 'Identified', 'Log', 'identify', 'load_log']
