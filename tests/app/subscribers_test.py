"""Subscribers of a run in real time over UDP multicast, in a network namespace of its own: every message of a run
arrives; four subscribers and one that reads nothing leave the cycle as it was, and what is lost is counted where it is
lost. Status 77 where no namespace can be made.

usage: subscribers_test.py PROGRAM PRIVATE_NETWORK_SCRIPT HELPER [SECONDS [PAIRS]]
"""
import pathlib
import re
import subprocess
import sys
import tempfile

from live import URL, Run, Subscriber, check, compare_timing, drive_for, enter_private_network, urgent


def receives_all(program, helper, folder, seconds, rate_Hz, tries=1):
    """The receiver's kernel buffer holds the messages that arrive while its process waits for the processor. It has room
    for some seconds of messages at 1 kHz and a tenth of that at 10 kHz: there a busy computer gets further tries."""
    url = f'{URL}&recv_buf_size={4 << 20}'
    subscriber = Subscriber(helper, url, urgent())
    run = Run(program, folder, *drive_for(folder, seconds), '--rate', rate_Hz, '--set',
              'realtime.max_consecutive_overruns=0', '--set', 'realtime.late_max_s=1000')
    summary = run.end(timeout=seconds + 60)
    subscriber.note_drops()
    seen = subscriber.result()
    granted = min(4 << 20, int(pathlib.Path('/proc/sys/net/core/rmem_max').read_text()))
    print(f'{rate_Hz} Hz for {seconds} s: {summary["cycles"]} cycles, {summary["overruns"]} late; {seen}; the kernel '
          f'dropped {subscriber.kernel_drops} at the receiver, whose buffer is 2 x {granted} bytes', flush=True)
    if tries > 1 and (summary['telemetry_drops'] or subscriber.kernel_drops):
        print(f'the processor was taken away for too long ({summary["telemetry_drops"]} records lost): again', flush=True)
        return receives_all(program, helper, folder, seconds, rate_Hz, tries - 1)
    check((summary['telemetry_drops'], summary['publish_failures']) == (0, 0), 'the run dropped nothing',
          summary['telemetry_drops'], summary['publish_failures'])
    check(subscriber.kernel_drops == 0, 'the receiver dropped nothing', subscriber.kernel_drops)
    check((seen['received'], seen['lost'], seen['malformed']) == (summary['cycles'], 0, 0),
          f'each of {summary["cycles"]} messages arrived', seen)


def nobody_slows_the_cycle(program, helper, folder, seconds, pairs):
    without, with_ = [], []
    for _ in range(pairs):  # alternating, because the computer's load varies
        without.append(Run(program, folder, *drive_for(folder, seconds)).end())
        readers = [Subscriber(helper, URL) for _ in range(4)]
        # A small buffer, which fills up during the run.
        idle = Subscriber(helper, f'{URL}&recv_buf_size=65536')
        try:
            idle.stand_still()
            with_.append(Run(program, folder, *drive_for(folder, seconds)).end())
            idle.note_drops()
            for reader in readers:
                reader.note_drops()
            idle.go_on()
            results = [reader.result() for reader in readers]
            late = idle.result()
        finally:
            for subscriber in (*readers, idle):
                subscriber.end()
        cycles = with_[-1]['cycles']
        check((with_[-1]['telemetry_drops'], with_[-1]['publish_failures']) == (0, 0), 'the run drops nothing itself')
        for reader, seen in zip(readers, results):
            missing = cycles - seen['received']
            check(missing == 0 or reader.kernel_drops >= missing, 'a reader misses only what its own buffer dropped',
                  cycles, seen, reader.kernel_drops)
        missing = cycles - late['received']
        check(0 < missing <= idle.kernel_drops, 'a subscriber that does not read loses only messages of its own buffer',
              cycles, late, idle.kernel_drops)
        print(f'{cycles} cycles; readers missed {[cycles - seen["received"] for seen in results]}; who read nothing '
              f'missed {missing}, the kernel dropped {idle.kernel_drops} datagrams of all channels there', flush=True)
    compare_timing('4 subscribers, 1 idle', without, with_)


def publishes_faster_than_10_kHz(helper, count=50_000):
    """At the highest speed, with a subscriber."""
    subscriber = Subscriber(helper, f'{URL}&recv_buf_size={4 << 20}', urgent())
    said = subprocess.run([helper, 'publish', URL, str(count), '0', '/dev/null'], capture_output=True, text=True, timeout=60)
    subscriber.end()
    found = re.search(r'published (\d+) in ([\d.]+) s, failures (\d+)', said.stdout)
    check(said.returncode == 0 and found, 'publishing at the highest speed', said)
    rate_Hz = int(found[1]) / float(found[2])
    check(int(found[3]) == 0 and rate_Hz > 10_000, f'{rate_Hz:.0f} messages/s are published, none refused', said.stdout)


def main():
    program, private_network, helper = sys.argv[1:4]
    seconds, pairs = int(sys.argv[4]) if len(sys.argv) > 4 else 4, int(sys.argv[5]) if len(sys.argv) > 5 else 2
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as folder:
        receives_all(program, helper, folder, seconds, 1000)
        receives_all(program, helper, folder, min(seconds, 10), 10_000, tries=3)
        publishes_faster_than_10_kHz(helper)
        nobody_slows_the_cycle(program, helper, folder, min(seconds, 10), pairs)


if __name__ == '__main__':
    main()
