"""A small reader of DBC files and of candump's logs: enough to decode what the CAN tests record, independent of the
program's own tables. Little-endian signals only, as config/can/abs_rig.dbc has them."""
import pathlib
import re

MESSAGE = re.compile(r'BO_ (\d+) (\w+): (\d+) (\w+)')
SIGNAL = re.compile(r' SG_ (\w+) : (\d+)\|(\d+)@1([+-]) \(([^,]+),([^)]+)\) \[([^|]+)\|([^\]]+)\]')
# "(1700000000.000000) vcan0 081#0011223344556677"; CAN FD: "##" and a digit of flags
LOGGED = re.compile(r'\((\d+\.\d+)\) (\w+) ([0-9A-F]+)(##.|#)([0-9A-F]*)')


class Dbc:
    def __init__(self, path):
        self.messages = {}
        for line in pathlib.Path(path).read_text(encoding='utf-8').splitlines():
            if found := MESSAGE.match(line):
                signals = {}
                self.messages[int(found[1])] = (found[2], int(found[3]), signals)
            elif found := SIGNAL.match(line):
                signals[found[1]] = (int(found[2]), int(found[3]), found[4] == '-', *map(float, found.groups()[4:]))

    def decode(self, identifier, data):
        """(message's name, {signal: value}); raises ValueError for what the file does not allow."""
        if identifier not in self.messages:
            raise ValueError(f'no message {identifier:#x}')
        name, length, signals = self.messages[identifier]
        if len(data) != length:
            raise ValueError(f'{name}: {len(data)} bytes instead of {length}')
        bits = int.from_bytes(data, 'little')
        values = {}
        for signal, (start, count, signed, scale, offset, least, most) in signals.items():
            raw = bits >> start & (1 << count) - 1
            if signed and raw >> count - 1:
                raw -= 1 << count
            values[signal] = raw * scale + offset
            if not least - scale / 2 <= values[signal] <= most + scale / 2:
                raise ValueError(f'{name}.{signal} = {values[signal]}: not in [{least}, {most}]')
        return name, values


def frames_of(path):
    """(time_s, identifier, data) of each frame in a log of candump -L."""
    for line in pathlib.Path(path).read_text(encoding='ascii').splitlines():
        if found := LOGGED.match(line):
            yield float(found[1]), int(found[3], 16), bytes.fromhex(found[5])
