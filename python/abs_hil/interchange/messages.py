"""ROS 2 messages of runs: their definitions, and their bytes in CDR (little endian).

All but the log's are flat structs of float64. Both PlotJuggler and Foxglove read these.
"""
import re
import struct
from collections.abc import Iterable, Sequence

import numpy as np

_LITTLE_ENDIAN = b'\x00\x01\x00\x00'

#: rcl_interfaces/msg/Log, which Foxglove shows as a log
LOG_TYPE = 'rcl_interfaces/msg/Log'
LOG_DEFINITION = """\
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
#: levels of that message
INFO, WARNING, ERROR = 20, 30, 40


def field_names(columns: Iterable[str]) -> dict[str, str]:
    """column -> name of its field. ROS 2 allows lower-case letters, digits and single '_' within a name only."""
    taken: dict[str, str] = {}
    for column in columns:
        base = re.sub('_+', '_', column.lower()).strip('_')
        name = base if base[:1].isalpha() else f'x_{base}'.rstrip('_')
        number = 2
        while name in taken.values():
            name, number = f'{base}_{number}', number + 1
        taken[column] = name
    return taken


def definition(fields: Iterable[tuple[str, str]]) -> str:
    """The definition of a flat struct from (column, comment) of its fields."""
    comments = dict(fields)
    return ''.join(f'float64 {name}  # {column}: {comments[column]}'.rstrip(': ') + '\n'
                   for column, name in field_names(comments).items())


def rows(columns: Sequence[np.ndarray]) -> list[bytes]:
    """One message a row of the columns, all of shape (rows,)."""
    table = np.column_stack([np.asarray(column, dtype='<f8') for column in columns])
    return [_LITTLE_ENDIAN + row.tobytes() for row in table]


def row(values: Sequence[float]) -> bytes:
    """One message of a flat struct."""
    return _LITTLE_ENDIAN + struct.pack(f'<{len(values)}d', *values)


def log(stamp_ns: int, level: int, name: str, text: str) -> bytes:
    """A message of the type LOG_TYPE."""
    body = struct.pack('<iIB', stamp_ns // 1_000_000_000, stamp_ns % 1_000_000_000, level)
    for word in (name, text, '', ''):
        data = word.encode() + b'\0'
        body += b'\0' * (-len(body) % 4) + struct.pack('<I', len(data)) + data
    return _LITTLE_ENDIAN + body + b'\0' * (-len(body) % 4) + struct.pack('<I', 0)
