"""usage: lcm_recordings.py FOLDER JOB..., in a private network (scripts/in_private_network.sh)

Plays logs with lcm-logplayer and records them with lcm-logger. Each JOB is OUT=LOG+LOG,LOG: a recording of the
logs between '+' at the same time, and then of those after ','; with '>>' in place of '=' it is appended to OUT.
"""
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import time

URL = 'udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304'
#: of LCM's port 7667
SOCKET = ':1DF3 '
MOST_S = 20


def wait_until(holds):
    """The outside of LCM's tools shows only their sockets and their files."""
    end = time.monotonic() + MOST_S
    while not holds() and time.monotonic() < end:
        time.sleep(0.02)


def listeners():
    return pathlib.Path('/proc/net/udp').read_text().count(SOCKET)


def record(out, groups, append):
    before = out.stat().st_size if append else 0
    # With a last message of somebody else's, after whose arrival the file holds all.
    groups = [*groups, [out.with_name('end')]]
    groups[-1][0].write_bytes(struct.pack('>IqqII', 0xEDA1DA01, 0, 10 ** 15, 3, 4) + b'ENDover')
    wanted = before + sum(os.path.getsize(log) for group in groups for log in group)
    mode = '--append' if append else '--force'
    logger = subprocess.Popen(['lcm-logger', '-q', '--flush-interval=1', f'--lcm-url={URL}', mode, out])
    wait_until(listeners)
    time.sleep(0.3)  # then it enters its handlers
    for group in groups:
        players = [subprocess.Popen(['lcm-logplayer', '--speed=4', f'--lcm-url={URL}', log], stdout=subprocess.DEVNULL)
                   for log in group]
        for player in players:
            assert player.wait() == 0
    wait_until(lambda: out.stat().st_size >= wanted)
    logger.send_signal(signal.SIGINT)
    assert logger.wait() == 0
    wait_until(lambda: listeners() == 0)


for job in sys.argv[2:]:
    name, mark, logs = re.fullmatch(r'(.*?)(=|>>)(.*)', job).groups()
    folder = pathlib.Path(sys.argv[1])
    record(folder / name, [[folder / log for log in group.split('+')] for group in logs.split(',')], mark == '>>')
