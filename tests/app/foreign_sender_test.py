"""With ttl=0 abs_hil obeys this computer's senders alone; with ttl=1 it obeys the network's. In a network namespace of
its own, where a socket with a foreign source address stands for another computer. Needs root there; status 77 without.

usage: foreign_sender_test.py PROGRAM PRIVATE_NETWORK_SCRIPT PYTHON_MODULE_DIR
"""
import socket
import struct
import sys
import tempfile
import time

from commands_test import Wire
from live import Run, check, drive_for, enter_private_network

FOREIGN = '10.99.99.99'
GROUP = ('239.255.76.67', 7667)


def sender(foreign):
    """A socket that sends to LCM's group, from an address that is not this computer's if `foreign`."""
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 1)
    if foreign:
        out.setsockopt(socket.SOL_IP, 19, 1)  # IP_TRANSPARENT
        out.bind((FOREIGN, 0))
        loopback = struct.pack('@4s4si', bytes(4), bytes(4), socket.if_nametoindex('lo'))
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, loopback)
    return out


def stop_message():
    import abs_hil
    stop = abs_hil.command_t()
    stop.command = 'stop'
    return stop.encode()


def stops(program, url, foreign):
    """Whether a stop ends the run."""
    with tempfile.TemporaryDirectory() as folder:
        run = Run(program, folder, *drive_for(folder, 6), '--lcm-url', url)
        wire, out = Wire(), sender(foreign)
        wire.raw = lambda datagram: out.sendto(datagram, GROUP)
        time.sleep(1.5)
        for _ in range(5):
            wire.message(b'ABS_COMMAND', stop_message())
            time.sleep(0.1)
        run.process.communicate(timeout=120)
        check(run.process.returncode in (0, 1), 'the run ended in order', run.process.returncode)
        return run.process.returncode == 1


def main():
    program, private_network, module = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    sys.path.insert(0, module)
    try:
        sender(True)
    except PermissionError as error:
        print(f'SKIPPED: no foreign source address here: {error}')
        sys.exit(77)
    group = 'udpm://%s:%d' % GROUP
    for url in (f'{group}?ttl=0', group):
        check(stops(program, url, foreign=False), f'{url}: a stop from this computer ends the run')
        check(not stops(program, url, foreign=True), f'{url}: a stop from elsewhere does not')
    check(stops(program, f'{group}?ttl=1', foreign=True), 'ttl=1: a stop from elsewhere ends the run')


if __name__ == '__main__':
    main()
