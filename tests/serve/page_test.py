"""The page in headless Chromium, with real clicks and keys, against a played log and a run that takes commands.

usage: page_test.py ABS_HIL ABS_SERVE PRIVATE_NETWORK_SCRIPT [FOLDER for screenshots]
"""
import asyncio
import base64
import pathlib
import shutil
import subprocess
import sys
import tempfile

from chromium import Chromium
from live import check, enter_private_network
from scope import Served, Viewer, cycles_of

#: time enough for everything, on a busy computer too
LONG = '''description = "brake early, then drive"
[[phase]]
name = "accelerate"
motor = 1.0
until = { lasts_s = 3 }
[[phase]]
name = "brake"
brake = "controller"
until = { lasts_s = 0.8 }
[[phase]]
name = "drive"
motor = 0.2
until = { lasts_s = 300 }
'''
SIZES = {'wide': (1400, 900), 'phone': (390, 844)}


class Page(Chromium):
    def __init__(self, folder, link, size='wide', scheme='light'):
        width, height = SIZES[size]
        super().__init__(folder, 'about:blank', width, height)
        self.call('Emulation.setDeviceMetricsOverride', width=width, height=height, deviceScaleFactor=1, mobile=size == 'phone')
        self.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': scheme}])
        self.call('Browser.setDownloadBehavior', behavior='allow', downloadPath=str(folder))
        self.call('Page.navigate', url=link)
        self.wait_for('document.querySelectorAll(".chart canvas").length == 4', 'the charts')

    def press(self, key, **more):
        codes = {'Escape': 27, 'ArrowLeft': 37, 'ArrowRight': 39, 'Tab': 9, 'Enter': 13, ' ': 32}
        down = {'text': key if len(key) == 1 else '\r'} if len(key) == 1 or key == 'Enter' else {}
        self.call('Input.dispatchKeyEvent', type='keyDown', key=key, windowsVirtualKeyCode=codes.get(key, ord(key[0].upper())),
                  **down, **more)
        self.call('Input.dispatchKeyEvent', type='keyUp', key=key, windowsVirtualKeyCode=codes.get(key, ord(key[0].upper())))

    def place(self, selector):
        """Where it stands once it stands still: new charts move what is below them."""
        places = [None]
        while len(places) < 2 or places[-1] != places[-2]:
            self.value(f'document.querySelector("{selector}").scrollIntoView({{block: "center"}})')
            self.value('new Promise((done) => setTimeout(done, 100))')
            places.append(self.value(f'(() => {{ const r = document.querySelector("{selector}").getBoundingClientRect(); '
                                     'return [r.left, r.top, r.width, r.height]; })()'))
        return places[-1]

    def click(self, selector, x=0.5, y=0.5):
        left, top, width, height = self.place(selector)
        held = {'button': 'left', 'clickCount': 1}
        at = (left + x * width, top + y * height)
        self.mouse('mouseMoved', *at)
        self.mouse('mousePressed', *at, **held)
        self.mouse('mouseReleased', *at, **held)

    def text(self, selector):
        return self.value(f'document.querySelector("{selector}").textContent')

    def choose(self, selector, value):
        self.value(f'(() => {{ const e = document.querySelector("{selector}"); e.value = "{value}"; '
                   'e.dispatchEvent(new Event("change")); })()')

    def picture(self, name):
        data = base64.b64decode(self.call('Page.captureScreenshot')['data'])
        if len(sys.argv) > 4:
            pathlib.Path(sys.argv[4], f'{name}.png').write_bytes(data)
        return len(data)


def looks(folder, server):
    for size in SIZES:
        for scheme in ('light', 'dark'):
            page = Page(folder / f'{size}-{scheme}', server.link, size, scheme)
            page.wait_for('document.getElementById("slip").dataset.points > 40', 'the slip curve')
            check(page.picture(f'{size}-{scheme}') > 20_000, f'{size}, {scheme}: a picture')
            wide = page.value('document.documentElement.scrollWidth')
            check(wide <= SIZES[size][0], f'{size}: nothing stands beyond the edge', wide)
            page.wait_for('document.getElementById("state").textContent == "no messages"', 'the end of the log')
            other = {'light': 'dark', 'dark': 'light'}[scheme]
            page.call('Emulation.setEmulatedMedia', features=[{'name': 'prefers-color-scheme', 'value': other}])  # makes new plots
            page.value('new Promise((done) => setTimeout(done, 500))')
            ends = page.value('[+document.getElementById("ribbon").dataset.end, document.querySelector(".chart .u-over")'
                              '.getBoundingClientRect().right - document.getElementById("ribbon").getBoundingClientRect().left]')
            check(abs(ends[0] - ends[1]) < 1.5, f'{size}: the ribbon ends where the charts do', ends)
            check(page.said == [], f'{size}, {scheme}: no error, nothing fetched from elsewhere', page.said)
            page.close()


def by_mouse(page, cycles):
    page.wait_for('document.getElementById("state").textContent == "no messages"', 'the end of the log')
    page.click('#freeze')
    page.wait_for('document.getElementById("state").textContent == "frozen"', 'frozen')
    left, top, width, height = page.place('.chart .u-over')
    page.drag(left + 0.6 * width, left + 0.8 * width, top + 0.5 * height)
    page.wait_for('!!window.scope.rows && window.scope.window()[1] - window.scope.window()[0] < 2.5', 'a drag zooms')
    low, high = page.value('window.scope.window()')
    rows = page.value('[window.scope.rows.count, window.scope.rows.columns[1][0]]')
    expected = [c['cycle'] for c in cycles if low <= c['time_s'] <= high]
    check(rows == [len(expected), expected[0]], 'a zoomed window shows each cycle', rows, len(expected), expected[0])
    page.click('.chart .u-over', 0.25)
    page.press('a')
    page.click('.chart .u-over', 0.75)
    page.press('b')
    page.wait_for('/\\d/.test(document.querySelector("#values tr:nth-child(2) td:last-child")?.textContent)', 'cursors')
    table = page.value('[...document.querySelectorAll("#values tr")].map(r => [...r.children].map(c => c.textContent))')
    a, b, difference = (float(cell) for cell in table[1][1:])
    check(abs(b - a - difference) < 1e-3 and abs(difference - (high - low) / 2) < 0.05, 'difference of the times', table[1])
    speed = next(row for row in table if row[0] == 'omega2_est_rad_s')
    near = [min(cycles, key=lambda c: abs(c['time_s'] - time))['omega2_est_rad_s'] for time in (a, b)]
    check(all(abs(float(shown) - value) < 0.02 for shown, value in zip(speed[1:], near)), 'values at the cursors', speed, near)


def by_keys(page):
    """Everything again without a mouse."""
    page.press('x')
    page.press('0')
    page.press('f')
    page.wait_for('document.getElementById("state").textContent != "frozen"', 'F goes on')
    page.press('f')
    page.wait_for('document.getElementById("state").textContent == "frozen"', 'F freezes')
    page.press('+')
    page.wait_for('window.scope.window()[1] - window.scope.window()[0] < 5.1', '+ zooms')
    page.press('ArrowRight')
    page.press('a')
    for _ in range(3):
        page.press('ArrowRight', modifiers=8)
    page.press('b')
    page.wait_for('/\\d/.test(document.querySelector("#values tr:nth-child(2) td:last-child")?.textContent)', 'cursors by keys')
    page.press('?')
    page.wait_for('!document.getElementById("help").hidden', '? shows the keys')
    page.value('document.activeElement.blur()')
    seen = set()
    for _ in range(60):
        page.press('Tab')
        seen.add(page.value('document.activeElement.id || document.activeElement.className'))
    check({'freeze', 'window', 'add', 'signal', 'level', 'arm', 'csv', 'mcap', 'close'} <= seen, 'Tab reaches each control', seen)


def downloads(page, folder, cycles):
    page.value('document.activeElement.blur()')
    for kind, key in (('csv', 'c'), ('mcap', 'm')):
        page.press(key)
        for _ in range(300):
            found = [file for file in folder.glob(f'*.{kind}') if file.stat().st_size]
            if found:
                break
            page.value('new Promise((done) => setTimeout(done, 100))')
        check(found, f'a {kind} file is saved', list(folder.iterdir()))


def charts_and_runs(page):
    page.choose('#add', 'zeta_N')
    page.wait_for('[...document.querySelectorAll(".chart b")].some(b => b.textContent.startsWith("zeta_N"))', 'a chart more')
    page.choose('#add', 'own')
    page.wait_for('document.querySelectorAll(".chart").length == 10', 'charts of the own signals')
    page.click('.chart:last-of-type .close')
    page.wait_for('document.querySelectorAll(".chart").length == 9', 'a chart less')


def triggers(program, serve, folder):
    """A level, a phase and an event, live; then commands."""
    key = folder / 'commands.key'
    key.write_text('0123456789abcdef0123456789abcdef')
    key.chmod(0o600)
    server = Served(serve, '--commands', key)
    log = folder / 'live.lcmlog'
    (folder / 'long.toml').write_text(LONG)
    run = subprocess.Popen([program, '--experiment', folder / 'long.toml', '--log', log, '--wait-for-start', '--set',
                            'commands.enabled=true', '--set', f'commands.key_file={key}'], stdout=subprocess.DEVNULL,
                           stderr=subprocess.PIPE, text=True)
    page = Page(folder / 'live', server.link)
    try:
        page.wait_for('window.scope.shown()[0]?.run.facts.commands.waiting === true', 'the run that waits')
        page.choose('#on', 'phase')
        page.choose('#phase', 'brake')
        page.value('document.getElementById("after").value = 0.5')
        page.click('#arm')
        page.choose('#command', 'start')
        page.click('#order button')
        page.wait_for('document.getElementById("answer").textContent.includes("start")', 'the start is answered')
        check('bad' not in page.value('document.getElementById("answer").className'), 'the run accepts the start')
        page.wait_for('document.getElementById("state").textContent == "frozen" && !!window.scope.rows', 'the trigger freezes')
        page.picture('trigger')
        said = page.text('#caught')
        page.press('f')
        page.choose('#on', 'event')
        page.choose('#event', 'stop request')
        page.click('#arm')
        page.wait_for('document.getElementById("caught").textContent == "waiting"', 'armed again')
        page.choose('#command', 'slip-ref')
        page.value('document.getElementById("value").value = 0.1')
        page.click('#order button')
        page.wait_for('document.getElementById("answer").textContent.includes("0.1")', 'a slip reference is answered')
        page.value('document.getElementById("before").focus()')
        page.press('Escape')
        page.wait_for('/stop/.test(document.getElementById("answer").textContent) && '
                      'document.getElementById("answer").textContent != "stop sent"', 'the stop is answered')
        _, errors = run.communicate(timeout=30)
        check(run.returncode == 1 and 'stopped by a command' in errors, 'Esc ended the run', run.returncode, errors[-500:])
        cycles = cycles_of(log)
        first = next(c['cycle'] for c in cycles if c['phase'] == 3)
        check(f'cycle {first}, brake' in said, 'the trigger caught the first cycle of braking', said, first)
        stopped = next(c['cycle'] for c in cycles if c['reason'] == 34)
        page.wait_for('document.getElementById("state").textContent == "frozen"', 'the stop freezes')
        said = page.text('#caught')
        check(f'cycle {stopped}, ' in said and 'command' in said, 'the trigger caught the stop in words', said, stopped)
        check(page.said == [], 'no error', page.said)
    finally:
        page.close()
        run.kill()
        server.end()


async def only_watches(server):
    async with Viewer(server.socket, ['slip']) as viewer:
        await viewer.ask(do='command', command='stop')
        await viewer.until(lambda: any(reply['kind'] == 'refused' for reply in viewer.replies), 'no commands without a key')


def main():
    program, serve, private_network = sys.argv[1:4]
    if not shutil.which('chromium'):
        print('SKIPPED: chromium is missing: scripts/setup.sh packages-report.txt installs it')
        sys.exit(77)
    enter_private_network(private_network, sys.argv)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = pathlib.Path(name)
        log = folder / 'run.lcmlog'
        subprocess.run([program, '--fast', '--no-lcm', '--log', log], check=True, capture_output=True)
        for sub in ('mouse', 'live', *(f'{size}-{scheme}' for size in SIZES for scheme in ('light', 'dark'))):
            (folder / sub).mkdir()
        server = Served(serve, log, '--speed', '0')
        try:
            looks(folder, server)
            asyncio.run(only_watches(server))
            cycles = cycles_of(log)
            page = Page(folder / 'mouse', server.link)
            by_mouse(page, cycles)
            by_keys(page)
            downloads(page, folder / 'mouse', cycles)
            charts_and_runs(page)
            check(page.said == [], 'no error', page.said)
            page.close()
        finally:
            check(server.end() == (143, ''), 'the server ends without a complaint')
        triggers(program, serve, folder)


if __name__ == '__main__':
    main()
