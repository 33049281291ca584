"""Many, hostile and slow clients: served, refused or dropped, while a run and a good viewer go on as if they were not there.

usage: load_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT
"""
import asyncio
import contextlib
import json
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlsplit

import websockets
from live import Run, check, drive_for, enter_private_network
from scope import Served, Viewer, answer, cycles_of, stuck

GARBAGE_FRAMES, CONNECTIONS, VIEWERS = 100_000, 200, 50
RUN_S, ATTACK_S, WINDOW_S = 12, 60, 5
PERIOD_US = 1000
#: what a queue of 15 s would hold: 0.5 MB of envelopes, as much of facts
MOST_GROWN_KB = 300
BUSY = """import socket
listening = socket.create_server(('127.0.0.1', 0))
sender = socket.create_connection(listening.getsockname())
receiver, _ = listening.accept()
while True:
    sender.send(b'x' * 50)
    receiver.recv(100)"""
#: what the page asks for
PAGE_SIGNALS = ['slip', 'slip_est', 'slip_ref', 'omega1_est_rad_s', 'omega2_est_rad_s', 'brake_torque_Nm', 'brake_torque_ref_Nm',
                'brake_torque_est_Nm', 'theta_N', 'theta_est_N', 'tyre_slip', 'tyre_force_N']


async def garbage(server):
    """One client that sends what is no request, until it is thrown out. (frames sent, thrown out)"""
    connection = await websockets.connect(server.socket)
    sent = 0
    with contextlib.suppress(websockets.ConnectionClosed):
        for number in range(1000):
            await connection.send((b'\0' * 50, '{"do":', '[[[[', '{"do":"show","signals":7}')[number % 4])
            sent += 1
    await asyncio.wait_for(connection.wait_closed(), 20)
    return sent, connection.close_code in (1006, 1008)  # with frames under way, the farewell may be lost


def connect_often(server):
    """(open connections, how many of them the server has closed at once)"""
    host = urlsplit(server.link)
    taken = []
    for _ in range(CONNECTIONS):
        with contextlib.suppress(OSError):
            taken.append(socket.create_connection((host.hostname, host.port), timeout=2))
    time.sleep(0.3)
    closed = 0
    for connection in taken:
        connection.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            try:
                closed += connection.recv(1) == b''
            except ConnectionResetError:
                closed += 1
    return taken, closed


async def attack(server, program, folder):
    """In one run, quiet, busy and attacked windows take turns: the run is the same in all, and the good viewer sees each bin.
    Busy: two processes send small packets to themselves, and know nothing of the server."""
    log = pathlib.Path(folder, 'attacked.lcmlog')
    windows, frames, thrown_out = [], 0, 0
    async with Viewer(server.socket, ['omega2_est_rad_s', 'cycle']) as good:
        run = Run(program, folder, *drive_for(folder, ATTACK_S), '--log', log)
        await asyncio.sleep(1)
        begin = time.monotonic()
        while time.monotonic() < begin + ATTACK_S - 3 * WINDOW_S - 3:
            windows.append([time.monotonic_ns()])
            await asyncio.sleep(WINDOW_S)
            windows[-1].append(time.monotonic_ns())
            busy = [subprocess.Popen([sys.executable, '-c', BUSY]) for _ in range(2)]
            await asyncio.sleep(WINDOW_S)
            for process in busy:
                process.kill()
                process.wait()
            windows[-1].append(time.monotonic_ns())
            silent = [await stuck(server) for _ in range(10)]
            taken, closed = await asyncio.to_thread(connect_often, server)
            end = time.monotonic() + WINDOW_S
            for connection in taken:
                connection.close()
            while time.monotonic() < end:
                sent, refused = await garbage(server)
                frames, thrown_out = frames + sent, thrown_out + refused
            windows[-1].append(time.monotonic_ns())
            for writer in silent:
                writer.transport.abort()
            check(closed >= CONNECTIONS - 128, f'of {CONNECTIONS} connections {closed} were closed at once', closed)
        summary = await asyncio.to_thread(run.end)
        print(f'{frames} garbage frames, {thrown_out} times thrown out', flush=True)
        check(frames >= GARBAGE_FRAMES and thrown_out >= GARBAGE_FRAMES / 1000, 'who sends garbage is thrown out',
              frames, thrown_out)
        check((summary['telemetry_drops'], summary['publish_failures']) == (0, 0), 'the run dropped nothing', summary)
        same_in_both(cycles_of(log), windows)
        facts = good.facts[max(good.facts)]
        missing = ATTACK_S * 50 - len(good.bins[max(good.facts)])
        check(good.dropped == 0 and missing * 20 <= facts['lost'] + 100, 'the good viewer got each bin', missing, facts['lost'])
    check(answer(server, '/')[0] == 200, 'afterwards the page is served as before')


def same_in_both(cycles, windows):
    """Wake-up lateness and cycle time in each kind of window. Other processes change the tails, which are only shown."""
    medians = {}
    for name in ('wakeup_latency_ns', 'cycle_ns'):
        for part, kind in enumerate(('quiet', 'busy', 'attacked')):
            values = sorted(cycle[name] / 1e3 for cycle in cycles
                            if any(window[part] <= cycle['stamp_ns'] < window[part + 1] for window in windows))
            shown = '/'.join(f'{values[min(int(share * len(values)), len(values) - 1)]:.0f}' for share in (0.5, 0.99, 0.999, 1.0))
            late = sum(value > PERIOD_US for value in values)
            medians[name, part] = values[len(values) // 2]
            print(f'{name:<18} {kind:<9} p50/p99/p99.9/max {shown} us, {late} of {len(values)} more than a period', flush=True)
    for name, slack_us in (('wakeup_latency_ns', 60), ('cycle_ns', 6)):
        check(medians[name, 2] <= 1.5 * medians[name, 0] + slack_us, f'{name}: the run is as quick under attack', medians)


async def fifty_viewers(server, program, folder):
    """Fifty pages and one that never reads: each of the fifty gets the whole run."""
    async with contextlib.AsyncExitStack() as stack:
        viewers = [await stack.enter_async_context(Counting(server.socket, PAGE_SIGNALS)) for _ in range(VIEWERS)]
        silent = await stuck(server)
        before_s, memory_kB = server.cpu_s(), server.memory_kB()
        summary = await asyncio.to_thread(Run(program, folder, *drive_for(folder, RUN_S)).end)
        await asyncio.sleep(1)
        used = (server.cpu_s() - before_s) / RUN_S
        print(f'{VIEWERS} viewers: {100 * used:.0f} % of a core, {server.memory_kB() - memory_kB} kB', flush=True)
        check((summary['telemetry_drops'], summary['publish_failures']) == (0, 0), 'the run dropped nothing')
        bins = {viewer.count for viewer in viewers}
        lost = max(viewer.facts[max(viewer.facts)]['lost'] for viewer in viewers)
        check({viewer.dropped for viewer in viewers} == {0} and len(bins) == 1 and min(bins) * 20 + lost + 100 >= RUN_S * 1000,
              f'each of {VIEWERS} viewers got the same {min(bins)} bins', bins, lost)
        refused = [await full(server) for _ in range(64 - VIEWERS)]
        check(refused[-1] and not refused[0], 'the viewer after the 64th is refused', refused)
        silent.transport.abort()


class Counting(Viewer):
    """Fifty that keep each value would be slower than the server."""
    count = 0

    async def _receive(self):
        async for message in self._connection:
            if isinstance(message, str):
                told = json.loads(message) if message.startswith('{"kind":"run"') else {'kind': ''}
                if told['kind'] == 'run':
                    self.facts[told['run']] = told
                continue
            _, _, _, count, _, self.dropped = struct.unpack_from('<6i', message)
            self.count += count


async def full(server):
    """Whether one more viewer is refused. One that is not stays until the server ends."""
    try:
        await websockets.connect(server.socket)
    except websockets.InvalidStatusCode as error:
        return error.status_code == 503
    return False


async def slow_reader(server, program, folder):
    """One that reads nothing for a while loses bins, is told how many, and then gets the newest ones."""
    process = await asyncio.create_subprocess_exec(program, *drive_for(folder, 30), stdout=subprocess.DEVNULL,
                                                   stderr=subprocess.DEVNULL)
    host = urlsplit(server.link)
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    small.connect((host.hostname, host.port))
    async with websockets.connect(server.socket, sock=small, max_queue=1, read_limit=1024, max_size=None) as slow:
        names = list(json.loads(await slow.recv())['signals'])
        transport = slow.transport
        await slow.send(json.dumps({'do': 'show', 'signals': names[:40], 'version': 1}))
        await asyncio.sleep(1)
        transport.pause_reading()
        await asyncio.sleep(4)
        memory_kB = server.memory_kB()
        await asyncio.sleep(15)
        grown_kB = server.memory_kB() - memory_kB
        check(grown_kB < MOST_GROWN_KB, f'a slow reader costs {grown_kB} kB in 15 s')
        transport.resume_reading()
        dropped = newest = 0
        end = time.monotonic() + 8
        while time.monotonic() < end:
            message = await slow.recv()
            if isinstance(message, bytes):
                dropped = int.from_bytes(message[20:24], 'little')
                newest = int.from_bytes(message[32:36], 'little')
        print(f'slow reader: {dropped} bins left out, newest {newest}', flush=True)
        check(newest > 20 * 50, 'afterwards it gets the newest bins', newest)
        check(dropped > 100, 'and is told how many were left out', dropped)
        await process.wait()


def main():
    program, serve, private_network = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as folder:
        for trial in (fifty_viewers, attack, slow_reader):
            server = Served(serve)
            try:
                asyncio.run(trial(server, program, folder))
            finally:
                ended = server.end()
            check(ended == (143, ''), 'the server ends without a complaint', ended)


if __name__ == '__main__':
    main()
