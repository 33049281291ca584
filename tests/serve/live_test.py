"""The scope against a run in real time at 1 kHz: no value outside the envelopes, the trigger's cycle, history for a late
page, downloads bit by bit, processor and memory.

usage: live_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT [SECONDS]
"""
import asyncio
import csv
import io
import math
import pathlib
import resource
import subprocess
import sys
import tempfile
import urllib.request

from live import check, drive_for, enter_private_network
from scope import BIN_S, Served, Viewer, cycles_of, outside

SIGNALS = ['omega1_est_rad_s', 'omega2_est_rad_s', 'slip', 'slip_est', 'brake_torque_ref_Nm', 'theta_N', 'theta_est_N',
           'wakeup_latency_ns', 'zeta_N', 'tyre_slip', 'tyre_force_N']
MOST_OF_A_RUN = 2.6
JUMP_N = 15.0
TRIES = 3
TYRE_B, TYRE_C = 28.0, 1.68  # of the plant paper-table1


def run_s():
    """Processor time of the runs that have ended. Their cycles wake a process 1,000 times a second, as their messages do
    the server: a slow computer needs more for both."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


async def with_a_viewer(program, server, folder, tries=TRIES):
    """A friction jump while braking."""
    log, csv_file = folder / f'{tries}.lcmlog', folder / f'{tries}.csv'
    async with Viewer(server.socket, SIGNALS) as viewer:
        await viewer.ask(do='trigger', on='level', signal='theta_N', level=JUMP_N, edge='fall')
        before_s, run_before_s = server.cpu_s(), run_s()
        run = await asyncio.create_subprocess_exec(
            program, '--experiment', 'friction-jump', '--log', log, '--csv', csv_file, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL)
        check(await run.wait() == 0, 'the run completes')
        cycles = cycles_of(log)
        number = max(viewer.facts)
        await viewer.until(lambda: viewer.facts[number]['cycles'] + viewer.facts[number]['lost'] >= len(cycles), 'all cycles')
        await asyncio.sleep(0.6)
        used_s = server.cpu_s() - before_s
        facts = viewer.facts[number]
        if facts['lost'] and tries > 1:
            print(f'{facts["lost"]} messages lost on the way to this busy process: again', flush=True)
            return await with_a_viewer(program, server, folder, tries - 1)
        check(facts['lost'] == 0 and viewer.dropped == 0, 'nothing lost, nothing left out', facts['lost'], viewer.dropped)
        wrong = outside(viewer.envelope(number), cycles, SIGNALS[:-2])
        check(not wrong, f'each of {len(cycles)} cycles lies within the envelopes', len(wrong), wrong[:3])
        length_s = cycles[-1]['time_s']
        part = used_s / (run_s() - run_before_s)
        check(part < MOST_OF_A_RUN, f'{used_s:.2f} s of the processor in {length_s:.1f} s, one viewer: {part:.2f} of the run')

        jump = next(c['cycle'] for b, c in zip(cycles, cycles[1:]) if b['theta_N'] > JUMP_N >= c['theta_N'])
        caught = next(reply for reply in viewer.replies if reply['kind'] == 'caught')
        check(caught['cycle'] == jump, 'the trigger caught the jump of friction in its cycle', caught, jump)

        forces_follow_the_tyre(viewer.bins[number], cycles)
        await viewer.ask(do='rows', run=number, from_s=caught['time_s'] - 0.1, to_s=caught['time_s'] + 0.1, version=1,
                         signals=['theta_N'])
        await viewer.until(lambda: viewer.rows, 'the cycles around the jump')
        time_s, cycle, theta_N = viewer.rows[0]
        expected = [c for c in cycles if time_s[0] <= c['time_s'] <= time_s[-1]]
        within = {c['cycle'] for c in cycles if abs(c['time_s'] - caught['time_s']) < 0.099}  # some are late
        check(len(within) > 100 and within <= set(cycle) and list(cycle) == [c['cycle'] for c in expected]
              and list(theta_N) == [c['theta_N'] for c in expected], 'each cycle around the jump', len(within), len(cycle))
        names = {facts['names'][name] for name in ('experiment', 'controller', 'backend')}
        check(names == {'friction-jump', 'adaptive', 'sim'}, 'names of the run', names)
        check([m['phase'] for m in facts['marks']][:2] == ['idle', 'accelerate'], 'marks of phases', facts['marks'])
        check(sum(facts['counts']['cycle_ns']) == len(cycles), 'the histogram counts each cycle')

        async with Viewer(server.socket, SIGNALS) as late:
            await late.until(lambda: len(late.bins.get(number, ())) == len(viewer.bins[number]), 'history for a late page')
            check(not outside(late.envelope(number), cycles, SIGNALS[:-2]), 'a late page has the whole run')
    downloaded(server, number, csv_file)


def forces_follow_the_tyre(bins, cycles):
    """The estimated force is that of the tyre's formula (4) at the true theta, wherever theta did not change for 0.1 s."""
    braking = [c for c in cycles if c['phase'] == 3]
    errors = []
    for number, parts in bins.items():
        slip, force_N = parts[0][1][-2:]
        theta_N = {c['theta_N'] for c in braking if -0.1 <= c['time_s'] - (number + 1) * BIN_S <= 0.0}
        if force_N == force_N and len(theta_N) == 1 and 0.1 < slip < 0.25:
            formula_N = theta_N.pop() * math.sin(TYRE_C * math.atan(TYRE_B * slip))
            errors.append(abs(force_N / formula_N - 1.0))
    errors.sort()
    check(len(errors) > 40, 'points of the slip curve while braking', len(errors))
    # Late cycles of a busy computer leave single windows with few samples.
    check(errors[len(errors) // 2] < 0.02 and errors[len(errors) * 9 // 10] < 0.1,
          f'forces are those of the tyre: median error {100 * errors[len(errors) // 2]:.1f} %', errors[-5:])


def downloaded(server, number, csv_file):
    link = f'{server.link}download.%s?run={number}&from_s=0&to_s=1000'
    with urllib.request.urlopen(link % 'csv') as answer:
        rows = list(csv.DictReader(io.StringIO(answer.read().decode())))
    with open(csv_file, newline='') as file:
        expected = list(csv.DictReader(file))
    check(list(rows[0]) == list(expected[0]), 'columns of the download are those of --csv', list(rows[0]), list(expected[0]))

    def as_number(text):
        return text if text.isalpha() and text != 'NaN' else 'NaN' if text == 'NaN' else float(text)
    different = [(a, b) for a, b in zip(rows, expected) if any(as_number(a[k]) != as_number(b[k]) for k in a)]
    check(len(rows) == len(expected) and not different, f'{len(rows)} rows of the download have the bits of --csv', different[:1])
    with urllib.request.urlopen(link % 'mcap') as answer:
        data = answer.read()
    from mcap.reader import make_reader
    messages = make_reader(io.BytesIO(data)).get_summary().statistics.channel_message_counts
    check(max(messages.values()) == len(expected), 'the MCAP file has each cycle', messages)


async def for_a_while(program, server, folder, seconds):
    """Memory and processor over a long run."""
    async with Viewer(server.socket, SIGNALS[:4]) as viewer:
        run_before_s = run_s()
        run = await asyncio.create_subprocess_exec(program, *drive_for(folder, seconds),
                                                   stdout=subprocess.DEVNULL)
        await asyncio.sleep(min(20, seconds / 3))
        memory_kB, cpu_s = server.memory_kB(), server.cpu_s()
        check(await run.wait() == 0, 'the long run completes')
        grown_kB, used = server.memory_kB() - memory_kB, (server.cpu_s() - cpu_s) / (seconds - min(20, seconds / 3))
        check(grown_kB < 4000, f'memory grew by {grown_kB} kB of {memory_kB} kB in {seconds} s')
        check(used < MOST_OF_A_RUN * (run_s() - run_before_s) / seconds, f'{100 * used:.1f} % of a core for one viewer')
        check(viewer.dropped == 0, 'nothing left out', viewer.dropped)


def main():
    program, serve, private_network = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    server = Served(serve)
    try:
        with tempfile.TemporaryDirectory() as folder:
            asyncio.run(with_a_viewer(program, server, pathlib.Path(folder)))
            if len(sys.argv) > 4:
                asyncio.run(for_a_while(program, server, pathlib.Path(folder), int(sys.argv[4])))
    finally:
        status, errors = server.end()
    check((status, errors) == (143, ''), 'the server ends by SIGTERM without a complaint', status, errors)


if __name__ == '__main__':
    main()
