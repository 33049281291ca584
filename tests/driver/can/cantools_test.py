"""cantools_test.py DBC FRAME_EXAMPLES PYTHON: cantools, with config/can/abs_rig.dbc, reads each frame that the code writes as the
code means it, and writes the same bytes. PYTHON is the interpreter that has cantools (scripts/setup_python.sh); skipped
where it is missing."""
import os
import subprocess
import sys

try:
    import cantools
except ImportError:
    if os.path.exists(sys.argv[3]) and sys.executable != sys.argv[3]:
        os.execv(sys.argv[3], [sys.argv[3], *sys.argv])
    print('SKIPPED: cantools is missing; scripts/setup_python.sh installs it')
    sys.exit(77)

database = cantools.database.load_file(sys.argv[1])
lines = subprocess.run([sys.argv[2]], check=True, capture_output=True, text=True).stdout.splitlines()
seen = {}
for line in lines:
    identifier, data, *signals = line.split()
    message, data = database.get_message_by_frame_id(int(identifier, 16)), bytes.fromhex(data)
    raw = {name: int(value) for name, value in (signal.split('=') for signal in signals)}
    assert len(data) == message.length, (line, message.length)
    decoded = message.decode(data, decode_choices=False, scaling=False)
    assert decoded == raw, (message.name, decoded, raw)
    assert message.encode(raw, scaling=False) == data, (message.name, line)
    for signal in message.signals:
        value = message.decode(data, decode_choices=False)[signal.name]
        assert signal.minimum <= value <= signal.maximum, (message.name, signal.name, value)
    seen[message.name] = seen.get(message.name, 0) + 1
assert set(seen) == {message.name for message in database.messages}, seen
print(f'cantools {cantools.__version__} reads and writes {len(lines)} frames of {len(seen)} messages as the code does')
