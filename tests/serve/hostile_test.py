"""Who may enter: wrong tokens, origins, names and paths are refused; forged messages on the network change nothing; and
downloads that nobody reads are closed.

usage: hostile_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT
"""
import asyncio
import json
import os
import pathlib
import socket
import struct
import sys
import tempfile
import time
from urllib.parse import urlsplit

import lcm
from live import URL, Run, check, drive_for, enter_private_network
from scope import Served, Viewer, answer

import abs_hil

HUGE = '9' * 400
MALFORMED = (b'GET / HTTP/1.1\r\nHost: [\r\n\r\n', 'GET / HTTP/1.1\r\nHost: localhost\u2100\r\n\r\n'.encode(),
             b'GET / HTTP/1.1\r\nHost: \xff\r\n\r\n', b'GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://[\r\n\r\n')
#: what the library for HTTP refuses by itself
GARBAGE = (b'\x16\x03\x01\r\n\r\n', b'GET / HTTP/1.1\r\nX: ' + b'x' * 9000 + b'\r\n\r\n',
           b'GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n',
           b'GET http://[ HTTP/1.1\r\n\r\n')
UPGRADE = (b'GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
           b'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n')
#: they are closed after 20 s
UNREAD, UNREAD_S = 4, 23


def raw(server, data, buffer=0):
    one = socket.socket()
    if buffer:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    one.settimeout(10)
    one.connect((urlsplit(server.link).hostname, urlsplit(server.link).port))
    one.sendall(data)
    return one


def whole(connection):
    data = b''
    while part := connection.recv(1 << 16):
        data += part
    return data


def malformed(server):
    for request in MALFORMED:
        with raw(server, request) as one:
            got = one.recv(100)
            check(got.startswith(b'HTTP/1.1 403'), f'{request[16:50]}: refused', got)
    for request in GARBAGE:
        with raw(server, request) as one:
            got = one.recv(100)
            check(got == b'' or b' 400 ' in got, f'{request[:30]}: garbage', got)
    for _ in range(5):  # pings, then a reset
        with raw(server, UPGRADE) as one:
            one.recv(100)
            one.sendall(100 * (b'\x89\xfd' + bytes(4) + b'x' * 125))
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))


async def commands(server):
    """Names that are none, and numbers that no float has."""
    async with Viewer(server.socket, []) as viewer:
        for asked in ({'do': 'command', 'command': 'gain', 'name': 'ka1\0b', 'value': 1.5},
                      {'do': 'command', 'command': 'gain', 'name': '\ud800', 'value': 1.5},
                      {'do': 'command', 'command': 'slip-ref', 'value': int(HUGE)},
                      {'do': 'trigger', 'on': 'level', 'signal': 'slip', 'edge': 'rise', 'level': int(HUGE)}):
            viewer.replies.clear()
            await viewer.ask(**asked)
            await viewer.until(lambda: viewer.replies, f'an answer to {asked}')
            check(viewer.replies[0]['kind'] == 'refused' and ': give' in viewer.replies[0]['text'],
                  f'{json.dumps(asked)[:60]}: refused', viewer.replies)


def unread(serve, program, folder):
    """Downloads that nobody reads: so many at once, and not for long."""
    log = pathlib.Path(folder, 'run.lcmlog')
    os.spawnl(os.P_WAIT, program, program, '--fast', '--no-lcm', '--log', str(log), '--summary', str(log.with_suffix('.json')))
    pathlib.Path('/proc/sys/net/ipv4/tcp_wmem').write_text('4096 16384 65536')  # else the kernel would hold all of it
    server = Served(serve, log, '--speed', 0)
    path = '/download.csv?run=0&from_s=0&to_s=1000'
    request = f'GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n'.encode()
    try:
        for _ in range(50):
            if answer(server, path)[0] == 200:
                break
            time.sleep(0.1)
        time.sleep(1)
        rows = answer(server, path)[1].count('\n')
        taken, heads = [], []
        for _ in range(UNREAD):  # one after the other: one file is made at a time
            taken.append(raw(server, request, 4096))
            heads.append(taken[-1].recv(12, socket.MSG_WAITALL))
        check(heads == UNREAD * [b'HTTP/1.1 200'], f'{UNREAD} downloads begin', heads)
        check(answer(server, path)[0] == 503, 'one more is refused', heads)
        check(answer(server, '/')[0] == 200, 'the page is served')
        time.sleep(UNREAD_S)
        check(answer(server, path)[1].count('\n') == rows > 1000, f'after {UNREAD_S} s there is room again: {rows} rows')
        lengths = []
        for one in taken:
            try:
                lengths.append(whole(one).count(b'\n'))
            except ConnectionResetError:
                lengths.append(0)
        check(max(lengths) < rows, 'what nobody read was closed', lengths)
    finally:
        check(server.end() == (143, ''), 'no complaint')


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
            if options[0] == '--commands':
                asyncio.run(commands(server))
        finally:
            check(server.end() == (143, ''), 'no complaint')
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
        check(answer(server, f'/download.csv?run={"[" * 3000}&from_s=0&to_s=1')[0] == 400, 'deep JSON is refused')
        malformed(server)
    finally:
        check(server.end() == (143, ''), 'no complaint')


def forged(type_name, **fields):
    message = getattr(abs_hil, type_name)()
    for name, value in fields.items():
        setattr(message, name, value)
    return message.encode()


async def hostile_network(server, program, folder):
    """Messages that nothing of abs_hil sends, then a run: it is shown as if they had not come. Each can be downloaded."""
    network, nan = lcm.LCM(URL), float('nan')
    async with Viewer(server.socket, ['omega2_est_rad_s', 'cycle']) as good:
        for data in (b'', b'x' * 50_000, forged('telemetry_t')[:-3], forged('telemetry_t', time_s=nan),
                     forged('telemetry_t', time_s=1e300), forged('telemetry_t', cycle=-1), forged('telemetry_t', phase=99),
                     forged('telemetry_t', cycle=100, names=',,a,a' * 5000, value_count=3, values=[nan] * 3,
                            phase_name='x' * 40_000, reason=-5, wakeup_latency_ns=-1 << 62)):
            network.publish('ABS_TELEMETRY', data)
        for cycle in range(200, 203):
            network.publish('ABS_TELEMETRY', forged('telemetry_t', cycle=cycle, time_s=0.3, value_count=4, values=[1.5] * 4,
                                                    names='good,a\n1,"x,' + 'y' * 33 + ',good'))
        for config in ('[' * 20_000, '{"plant": 7}', '{"model": {"r2_m": [], "r1_m": "x"}}', 'NaN'):
            network.publish('ABS_EXPERIMENT', forged('experiment_t', config_json=config, plant='<script>alert(1)</script>'))
        network.publish('ABS_EVENT', forged('event_t', time_s=nan, value=nan, kind='fault', reason=-1, message='x' * 50_000))
        network.publish('ABS_EVENT', forged('event_t', time_s=1e300, kind='fault\n', message='\0'))
        network.publish('ABS_STATUS', forged('status_t', unjudged_share=nan))
        summary = await asyncio.to_thread(Run(program, folder, *drive_for(folder, 3)).end)
        number = max(good.facts)
        await good.until(lambda: good.facts[number]['cycles'] + good.facts[number]['lost'] == summary['cycles'], 'all cycles')
        check(good.facts[number]['names']['plant'] == 'paper-table1', 'the run after forged messages is shown')
    expected = sum(row['csv_column'] is not None for row in abs_hil.QUANTITIES.values())
    for run, facts in good.facts.items():
        check(facts['own'] in ([], ['good'], ['a'], ['theta_hat_N', 'zeta_N']) or run == number, 'names of signals', facts['own'])
        path = f'/download.%s?run={run}&from_s=0&to_s=1000'
        status, text, _ = await asyncio.to_thread(answer, server, path % 'csv')
        lines = text.split('\n')
        check(status == 200 and {line.count(',') for line in lines[:-1]} == {expected + len(facts['own']) - 1},
              f'a table of run {run}', lines[:2])
        for to_s, refused in (('1000', 200), (HUGE, 400)):
            status, text, _ = await asyncio.to_thread(answer, server, path.replace('1000', to_s) % 'mcap')
            check(status == refused, f'MCAP of run {run}', text[:300])


def main():
    program, serve, private_network = sys.argv[1:4]
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory() as folder:
        who_may_enter(serve, folder)
        server = Served(serve)
        try:
            asyncio.run(hostile_network(server, program, folder))
        finally:
            ended = server.end()
        check(ended == (143, ''), 'the server ends without a complaint', ended)
        unread(serve, program, folder)


if __name__ == '__main__':
    main()
