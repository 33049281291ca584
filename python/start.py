"""Starts a program of the package beside this file: start.py NAME [ARGUMENT...]."""
import sys

from abs_hil.programs import start

sys.argv[0] = f'abs_{sys.argv[1]}'
sys.exit(start(sys.argv[1], sys.argv[2:]))
