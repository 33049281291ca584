"""Who may enter: wrong tokens, origins, names and paths are refused; and forged messages on the network change nothing.

usage: hostile_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT
"""
import asyncio
import os
import pathlib
import sys
import tempfile
from urllib.parse import urlsplit

import lcm
from live import URL, Run, check, drive_for, enter_private_network
from scope import Served, Viewer, answer

import abs_hil


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
                     forged('telemetry_t', cycle=100, names=',,a,a' * 5000, value_count=3, values=[nan] * 3,
                            phase_name='x' * 40_000, reason=-5, wakeup_latency_ns=-1 << 62)):
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
        server = Served(serve)
        try:
            asyncio.run(hostile_network(server, program, folder))
        finally:
            ended = server.end()
        check(ended == (143, ''), 'the server ends without a complaint', ended)


if __name__ == '__main__':
    main()
