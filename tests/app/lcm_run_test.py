"""A real-time run seen on LCM by lcm-logger, in a network namespace of its own: every cycle arrives, in order, and the
program's own event log holds the same; `stop` on ABS_COMMAND ends a run. Status 77 where no namespace can be made.

usage: lcm_run_test.py PROGRAM PRIVATE_NETWORK_SCRIPT COMMAND_HELPER
"""
import collections
import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import time

from live import PATIENT

URL = 'udpm://239.255.76.67:7667?ttl=0'
LOG_SYNC = 0xEDA1DA01


def messages(path):
    """Channel -> packets of an LCM event log."""
    data, at, found = pathlib.Path(path).read_bytes(), 0, collections.defaultdict(list)
    while at < len(data):
        sync, _, _, channel_bytes, packet_bytes = struct.unpack_from('>IqqII', data, at)
        assert sync == LOG_SYNC, f'{path}: no event at byte {at}'
        at += 28
        channel = data[at:at + channel_bytes].decode()
        found[channel].append(data[at + channel_bytes:at + channel_bytes + packet_bytes])
        at += channel_bytes + packet_bytes
    return found


def sequence_of(packet):
    """The second field of each of our messages, after the fingerprint and stamp_ns."""
    return struct.unpack_from('>q', packet, 16)[0]


def wait_for_listener():
    """Waits until a socket in this namespace listens on LCM's port 7667 = 0x1DF3, and until LCM has entered
    its handlers."""
    for _ in range(200):
        if ':1DF3 ' in pathlib.Path('/proc/net/udp').read_text():
            time.sleep(0.3)
            return
        time.sleep(0.05)
    raise AssertionError('no LCM listener within 10 s')


def whole_run(program, folder):
    # lcm-logger drops what it cannot read in time: give it priority over other processes, where permitted.
    urgent = ['chrt', '-f', '10'] if subprocess.run(['chrt', '-f', '10', 'true'], stderr=subprocess.DEVNULL).returncode == 0 else []
    logger = subprocess.Popen([*urgent, 'lcm-logger', '-q', f'{folder}/seen.lcmlog'])
    try:
        wait_for_listener()
        run = subprocess.run([program, *PATIENT, '--set', 'experiment.start_speed_rad_s=120', '--summary', f'{folder}/s.json',
                              '--log', f'{folder}/own.lcmlog'], capture_output=True, text=True, timeout=60)
        time.sleep(0.5)
    finally:
        logger.send_signal(signal.SIGINT)
        logger.wait(timeout=10)
    assert run.returncode == 0, run.stderr
    summary = json.loads(pathlib.Path(folder, 's.json').read_text())
    assert summary['telemetry_drops'] == 0 and summary['publish_failures'] == 0, summary
    for name in ('seen', 'own'):
        found = messages(f'{folder}/{name}.lcmlog')
        sequences = [sequence_of(packet) for packet in found['ABS_TELEMETRY']]
        assert sequences == list(range(summary['cycles'])), f'{name}: {len(sequences)} of {summary["cycles"]} messages'
        for channel in ('ABS_STATUS', 'ABS_EVENT', 'ABS_EXPERIMENT'):
            of_channel = [sequence_of(packet) for packet in found[channel]]
            assert of_channel and of_channel == list(range(len(of_channel))), f'{name}: {channel}: {of_channel}'
    seen, own = messages(f'{folder}/seen.lcmlog'), messages(f'{folder}/own.lcmlog')
    assert seen['ABS_TELEMETRY'] == own['ABS_TELEMETRY'], 'network and log carry the same bytes'
    print(f'{summary["cycles"]} cycles, each seen in order')


def stopped_by_command(program, helper, folder):
    run = subprocess.Popen([program, *PATIENT, '--summary', f'{folder}/stop.json'], stdout=subprocess.PIPE,
                           stderr=subprocess.PIPE, text=True)
    wait_for_listener()
    assert subprocess.run([helper, 'command', URL, 'stop'], timeout=20).returncode == 0
    _, errors = run.communicate(timeout=30)
    assert run.returncode == 1 and 'ABS_COMMAND' in errors, (run.returncode, errors)
    assert json.loads(pathlib.Path(folder, 'stop.json').read_text())['result'] == 'stopped'
    print('stop on ABS_COMMAND ended the run')


def main():
    program, private_network, helper = sys.argv[1:4]
    if 'inside' not in sys.argv:
        os.execv(private_network, [private_network, sys.executable, __file__, program, private_network, helper, 'inside'])
    with tempfile.TemporaryDirectory() as folder:
        whole_run(program, folder)
        stopped_by_command(program, helper, folder)


if __name__ == '__main__':
    main()
