"""A run in real time over tcpq, through the server of LCM's Java package on the loopback interface: every message
arrives; `abs_hil watch` and `abs_hil send` work; a server that dies, comes again, or has a subscriber who reads nothing
costs messages, which are counted, and never the run. Status 77 where Java or lcm.jar is missing.

usage: tcpq_test.py PROGRAM PRIVATE_NETWORK_SCRIPT HELPER [SECONDS [PAIRS]]
"""
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

from live import Run, Subscriber, check, compare_timing, drive_for, enter_private_network

PORT = 7700
URL = f'tcpq://127.0.0.1:{PORT}'
JAR = os.environ.get('LCM_JAR', '/usr/share/java/lcm.jar')


class Server:
    def __init__(self):
        self.process = subprocess.Popen(['java', '-cp', JAR, 'lcm.lcm.TCPService', str(PORT)], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        for _ in range(600):
            try:
                with socket.create_connection(('127.0.0.1', PORT), timeout=1):
                    return
            except OSError:
                time.sleep(0.05)
        raise AssertionError('the tcpq server does not begin within 30 s')

    def end(self):
        self.process.send_signal(signal.SIGCONT)
        self.process.kill()
        self.process.wait()


def every_message(program, helper, folder, seconds):
    server = Server()
    subscriber = Subscriber(helper, URL)
    summary = Run(program, folder, *drive_for(folder, seconds), '--lcm-url', URL).end()
    seen = subscriber.result()
    server.end()
    check((summary['telemetry_drops'], summary['publish_failures']) == (0, 0), 'no message is lost before the server',
          summary['telemetry_drops'], summary['publish_failures'])
    check((seen['received'], seen['lost']) == (summary['cycles'], 0), f'each of {summary["cycles"]} messages arrived', seen)


def clients(program, folder):
    server = Server()
    run = Run(program, folder, *drive_for(folder, 60), '--lcm-url', URL)
    watch = subprocess.run([program, 'watch', '--once', '--timeout', '20', '--lcm-url', URL], capture_output=True, text=True,
                           timeout=60)
    check(watch.returncode == 0 and 'accelerate' in watch.stdout and 'lost on the way 0' in watch.stdout, 'abs_hil watch',
          watch.returncode, watch.stdout, watch.stderr)
    stop = subprocess.run([program, 'send', 'stop', '--timeout', '20', '--lcm-url', URL], capture_output=True, text=True,
                          timeout=60)
    check(stop.returncode == 1 and 'stop accepted' in stop.stdout, 'abs_hil send stop', stop)
    run.process.communicate(timeout=60)
    check(run.process.returncode == 1, 'send stop ends the run', run.process.returncode)
    server.end()


def server_dies(program, helper, folder):
    """The server returns: the same subscriber continues, and the run has counted what it could not send."""
    server = Server()
    subscriber = Subscriber(helper, URL, silence_s=6)
    run = Run(program, folder, *drive_for(folder, 8), '--lcm-url', URL)
    time.sleep(2.5)
    server.end()
    time.sleep(1)
    server = Server()
    summary = run.end()
    seen = subscriber.result()
    server.end()
    print(f'{summary["cycles"]} cycles, {summary["publish_failures"]} messages not sent, {seen}')
    check(summary['telemetry_drops'] == 0 and 500 < summary['publish_failures'] < summary['cycles'],
          'a dead server costs messages, which are counted, but no record', summary['publish_failures'])
    check(seen['run_failures'] > 0 and seen['lost'] > 500, 'the subscriber learns the count after the return', seen)


# 2 MB/s fill the buffers: those of a server within two seconds, including a subscriber's within eight.
FAST = ['--rate', 4_000, '--set', 'realtime.max_consecutive_overruns=0', '--set', 'realtime.late_max_s=1000', '--lcm-url', URL]


def costs_messages_only(what, run):
    summary = run.end(timeout=30)
    print(f'{what}: {summary["cycles"]} cycles, {summary["publish_failures"]} messages not sent')
    check(summary['telemetry_drops'] == 0 and 1000 < summary['publish_failures'] < summary['cycles'],
          f'{what}: costs counted messages but no record, and the run still ends', summary['telemetry_drops'])


def server_stands_still(program, folder):
    server = Server()
    run = Run(program, folder, *drive_for(folder, 6), *FAST)
    time.sleep(2)
    server.process.send_signal(signal.SIGSTOP)
    costs_messages_only('a server that stands still', run)
    refused = subprocess.run([program, '--no-out', '--lcm-url', URL], capture_output=True, text=True, timeout=30)
    check(refused.returncode == 3 and 'does not answer' in refused.stderr, 'no run begins with this server', refused)
    server.end()


def subscriber_reads_nothing(program, helper, folder):
    server, idle = Server(), Subscriber(helper, URL)
    idle.stand_still()
    costs_messages_only('a subscriber who reads nothing', Run(program, folder, *drive_for(folder, 12), *FAST))
    idle.end()
    server.end()


def nobody_slows_the_cycle(program, helper, folder, seconds, pairs):
    without, with_ = [], []
    for _ in range(pairs):
        server = Server()
        without.append(Run(program, folder, *drive_for(folder, seconds), '--lcm-url', URL).end())
        server.end()
        server = Server()
        readers = [Subscriber(helper, URL) for _ in range(4)]
        idle = Subscriber(helper, URL)
        try:
            idle.stand_still()
            with_.append(Run(program, folder, *drive_for(folder, seconds), '--lcm-url', URL).end(timeout=60))
            idle.go_on()
            results = [reader.result() for reader in readers]
        finally:
            server.end()
            for subscriber in (*readers, idle):
                subscriber.end()
        summary = with_[-1]
        print(f'{summary["cycles"]} cycles, {summary["publish_failures"]} messages not sent; readers got '
              f'{[seen["received"] for seen in results]}', flush=True)
        check(summary['telemetry_drops'] == 0, 'no record is lost')
        missed = [summary['cycles'] - summary['publish_failures'] - seen['received'] for seen in results]
        check(all(count <= 0 for count in missed), 'each reader got what was sent', missed)
    compare_timing('4 subscribers, 1 idle', without, with_)


def main():
    program, private_network, helper = sys.argv[1:4]
    seconds, pairs = int(sys.argv[4]) if len(sys.argv) > 4 else 3, int(sys.argv[5]) if len(sys.argv) > 5 else 2
    if not shutil.which('java') or not pathlib.Path(JAR).exists():
        print(f"SKIPPED: LCM's tcpq server is in its Java package: java or {JAR} is missing")
        sys.exit(77)
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as folder:
        every_message(program, helper, folder, seconds)
        clients(program, folder)
        server_dies(program, helper, folder)
        server_stands_still(program, folder)
        subscriber_reads_nothing(program, helper, folder)
        # What an idle subscriber leaves unread must fit into the buffers before it. Once they are full, after some 10
        # s, LCM's server delays everybody else too (docs/telemetry.md).
        nobody_slows_the_cycle(program, helper, folder, min(seconds, 5), pairs)


if __name__ == '__main__':
    main()
