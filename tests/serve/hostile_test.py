"""Hostile and slow clients: refused or dropped, while a run and a good viewer go on as if they were not there.

usage: hostile_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT
"""
import asyncio
import contextlib
import http.client
import json
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlsplit

import abs_hil
import lcm
import websockets
from live import URL, Run, check, compare_timing, drive_for, enter_private_network
from scope import Served, Viewer

GARBAGE_FRAMES, CONNECTIONS = 100_000, 200
RUN_S = 12


def answer(server, path, **headers):
    connection = http.client.HTTPConnection(urlsplit(server.link).netloc, timeout=10)
    connection.request('GET', path, headers={name.replace('_', '-'): value for name, value in headers.items()})
    got = connection.getresponse()
    return got.status, got.read().decode(errors='replace'), got.headers


def who_may_enter(serve, folder):
    key = pathlib.Path(folder, 'commands.key')
    key.write_text('0123456789abcdef0123456789abcdef')
    key.chmod(0o644)
    refused = os.spawnl(os.P_WAIT, serve, serve, '--port', '0', '--commands', str(key))
    check(refused == 2, 'a key that others can read is refused with status 2', refused)
    key.chmod(0o600)
    for options in (('--commands', key), ('--host', '0.0.0.0')):
        server = Served(serve, *options)
        path = urlsplit(server.link).path
        server.link = server.link.replace('0.0.0.0', '127.0.0.1')
        try:
            check(len(path) > 30, 'the link has a token', path)
            check(answer(server, path)[0] == 200, 'the whole link is answered')
            for wrong in ('/', '/ws', '/page.js', '/x' + path[1:], path[:-2] + '/', '/%00/', '//'):
                check(answer(server, wrong)[0] == 403, f'{wrong}: wrong or no token', answer(server, wrong)[:2])
        finally:
            server.end()
    server = Served(serve)
    try:
        status, _, headers = answer(server, '/')
        check(status == 200 and "default-src 'none'" in headers['Content-Security-Policy']
              and 'unsafe' not in headers['Content-Security-Policy'], 'a strict policy', headers)
        check(answer(server, '/', Host='evil.example')[0] == 403, 'a foreign name that leads here is refused')
        for path in ('/', '/ws', '/download.csv?run=0&from_s=0&to_s=1'):
            check(answer(server, path, Origin='http://evil.example')[0] == 403, f'{path}: a foreign origin is refused')
            check(answer(server, path, Sec_Fetch_Site='cross-site')[0] == 403, f'{path}: a foreign page is refused')
        for path in ('/../server.py', '/..%2fserver.py', '/server.py', '/etc/passwd', '/' + 'x' * 5000):
            check(answer(server, path)[0] in (400, 404), f'{path[:30]}: no such page', answer(server, path)[:2])
        check(answer(server, '/download.csv?run=0&from_s=nan&to_s=1')[0] == 400, 'a download of nothing is refused')
    finally:
        check(server.end() == (143, ''), 'no complaint')


async def garbage(server):
    """10^5 frames that are no request."""
    sent = refused = 0
    began = time.monotonic()
    while sent < GARBAGE_FRAMES and time.monotonic() < began + RUN_S - 4:
        connection = await websockets.connect(server.socket)
        with contextlib.suppress(websockets.ConnectionClosed):
            for number in range(1000):
                await connection.send((b'\0' * 50, '{"do":', '[[[[', '{"do":"show","signals":7}')[number % 4])
                sent += 1
        await asyncio.wait_for(connection.wait_closed(), 20)
        refused += connection.close_code in (1006, 1008)  # with frames under way, the farewell may be lost
    return sent, refused


async def stuck(server):
    """Asks for all signals and never reads."""
    host = urlsplit(server.link)
    reader, writer = await asyncio.open_connection(host.hostname, host.port, limit=1)
    reader._transport.pause_reading()
    writer.write(f'GET /ws HTTP/1.1\r\nHost: {host.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
                 'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n'.encode())
    return writer


def connect_often(server):
    host = urlsplit(server.link)
    taken = []
    for _ in range(CONNECTIONS):
        try:
            taken.append(socket.create_connection((host.hostname, host.port), timeout=2))
        except OSError:
            break
    return taken


async def attack(server, program, folder):
    """The good viewer sees each bin of the run, and the run is as it was alone."""
    alone = Run(program, folder, *drive_for(folder, 4)).end()
    async with Viewer(server.socket, ['omega2_est_rad_s', 'cycle']) as good:
        silent = [await stuck(server) for _ in range(10)]
        with_ = Run(program, folder, *drive_for(folder, RUN_S))
        sent, refused = await garbage(server)
        taken = connect_often(server)
        while with_.process.poll() is None:
            await asyncio.sleep(0.1)
        summary = with_.end()
        print(f'{sent} garbage frames, {refused} times thrown out', flush=True)
        check(sent > 1000 and refused > 10, 'who sends garbage is thrown out', sent, refused)
        check((summary['telemetry_drops'], summary['publish_failures']) == (0, 0), 'the run dropped nothing', summary)
        compare_timing('hostile clients', [alone], [summary])
        number = max(good.facts)
        seconds = sorted(good.bins[number])
        check(good.dropped == 0 and len(seconds) >= RUN_S * 50 - 5, 'the good viewer got each bin', len(seconds), good.dropped)
        for connection in taken:
            connection.close()
        for writer in silent:
            writer.transport.abort()
    check(answer(server, '/')[0] == 200, 'afterwards the page is served as before')


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
        await asyncio.sleep(16)
        memory_kB = server.memory_kB()
        await asyncio.sleep(3)
        check(server.memory_kB() < memory_kB + 2000, 'a slow reader costs no memory', memory_kB, server.memory_kB())
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


def forged(type_name, **fields):
    message = getattr(abs_hil, type_name)()
    for name, value in fields.items():
        setattr(message, name, value)
    return message.encode()


async def hostile_network(server, program, folder):
    """Messages that nothing of abs_hil sends, then a run: it is shown as if they had not come."""
    network, nan = lcm.LCM(URL), float('nan')
    async with Viewer(server.socket, ['omega2_est_rad_s', 'cycle']) as good:
        for data in (b'', b'x' * 50_000, forged('telemetry_t')[:-3], forged('telemetry_t', time_s=nan),
                     forged('telemetry_t', time_s=1e300), forged('telemetry_t', cycle=-1), forged('telemetry_t', phase=99),
                     forged('telemetry_t', cycle=100, names=',,a,a' * 5000, value_count=3, values=[nan] * 3, phase_name='x' * 40_000,
                            reason=-5, wakeup_latency_ns=-1 << 62)):
            network.publish('ABS_TELEMETRY', data)
        for config in ('[' * 20_000, '{"plant": 7}', '{"model": {"r2_m": [], "r1_m": "x"}}', 'NaN'):
            network.publish('ABS_EXPERIMENT', forged('experiment_t', config_json=config, plant='<script>alert(1)</script>'))
        network.publish('ABS_EVENT', forged('event_t', time_s=nan, value=nan, kind='fault', reason=-1, message='x' * 50_000))
        network.publish('ABS_STATUS', forged('status_t', unjudged_share=nan))
        summary = await asyncio.to_thread(Run(program, folder, *drive_for(folder, 3)).end)
        number = max(good.facts)
        await good.until(lambda: good.facts[number]['cycles'] + good.facts[number]['lost'] == summary['cycles'], 'all cycles')
        check(good.facts[number]['names']['plant'] == 'paper-table1', 'the run after forged messages is shown')


def main():
    program, serve, private_network = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as folder:
        who_may_enter(serve, folder)
        for trial in (hostile_network, attack, slow_reader):
            server = Served(serve)
            try:
                asyncio.run(trial(server, program, folder))
            finally:
                ended = server.end()
            check(ended == (143, ''), 'the server ends without a complaint', ended)


if __name__ == '__main__':
    main()
