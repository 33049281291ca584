"""abs-spy for real: on a screen of its own (Xvfb) in a network namespace of its own it watches a running experiment, with
every Java that is installed and with both LCMs (Debian's and the one of Python's package lcm). lcm-spy's table shows the
telemetry channel decoded at 1 kHz; a double click opens a channel's fields, which change. A probe inside the Java machine
(SpyProbe) reads the windows, clicks are a real mouse's (xdotool). And every missing piece is named.

usage: spy_test.py PROGRAM ABS_SPY PRIVATE_NETWORK_SCRIPT PROBE_JAR LCM_PYTHON [PICTURE]
Status 77, with the reason, where a tool is missing. PICTURE is written if it is named.
"""
import glob
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

PROGRAM, ABS_SPY, PRIVATE_NETWORK, PROBE_JAR, LCM_PYTHON = map(os.path.abspath, sys.argv[1:6])
PICTURE = next((a for a in sys.argv[6:] if a != 'inside'), None)
TOOLS = ['Xvfb', 'xdotool', 'import', 'compare', 'convert', 'java']


class Screen:
    """An X server that only this test sees."""

    def __enter__(self):
        read, write = os.pipe()
        self.server = subprocess.Popen(['Xvfb', '-displayfd', str(write), '-screen', '0', '1000x900x24', '-nolisten', 'tcp'],
                                       pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as pipe:
            self.name = ':' + pipe.readline().strip()
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()

    def tool(self, *command):
        return subprocess.run(command, env={**os.environ, 'DISPLAY': self.name}, check=True, capture_output=True, text=True,
                              timeout=30).stdout

    def click(self, x, y, times=1):
        self.tool('xdotool', 'mousemove', x, y, 'click', '--repeat', str(times), '--delay', '60', '1')

    def move(self, title, x, y):
        window = self.tool('xdotool', 'search', '--onlyvisible', '--name', f'^{re.escape(title)}$').split()[0]
        self.tool('xdotool', 'windowmove', window, str(x), str(y))


class Windows:
    """What the probe saw last."""

    def __init__(self, path):
        self.path = pathlib.Path(path)

    def lines(self, kind):
        text = self.path.read_text() if self.path.exists() else ''
        return [line.split('\t')[1:] for line in text.splitlines() if line.startswith(kind + '\t')]

    def channels(self):
        """Channel -> column -> text."""
        rows = {}
        for row, column, text, _, _ in self.lines('cell'):
            rows.setdefault(row, {})[column] = text
        return {row['Channel']: row for row in rows.values()}

    def place(self, channel):
        row = next(row for row, column, text, _, _ in self.lines('cell') if column == 'Channel' and text == channel)
        return next((x, y) for r, column, _, x, y in self.lines('cell') if r == row and column == 'Channel')

    def titles(self):
        return [title for title, *_ in self.lines('window')]

    def until(self, what, seconds, condition):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            time.sleep(0.25)
        seen = self.path.read_text() if self.path.exists() else 'nothing'
        raise AssertionError(f'{what}: not within {seconds} s; the windows show\n{seen}')


def at_full_rate(windows):
    row = windows.channels().get('ABS_TELEMETRY', {})
    return row.get('Type') == 'telemetry_t' and 900 <= float(row['Hz']) <= 1100 and row['Undecodable'] == '0' and row


def watch_a_run(screen, folder, environment, lcm_jar, picture):
    windows = Windows(f'{folder}/windows.txt')
    with open(f'{folder}/spy.log', 'w') as log:
        spy = subprocess.Popen([ABS_SPY], stdout=log, stderr=subprocess.STDOUT, env={
            **os.environ, **environment, 'DISPLAY': screen.name,
            'JAVA_TOOL_OPTIONS': f'-javaagent:{PROBE_JAR}={folder}/windows.txt'})
    run = None
    try:
        windows.until("lcm-spy's window", 60, lambda: any(title.startswith('LCM Spy') for title in windows.titles()))
        command = pathlib.Path(f'/proc/{spy.pid}/cmdline').read_text()
        assert lcm_jar in command, f'{lcm_jar} is not the one in use: {command}'
        # The paper's braking after 5.2 s, and enough before it.
        run = subprocess.Popen([PROGRAM, '--backend', 'sim', '--set', 'realtime.cycle_gap_max_s=10'], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
        row = windows.until('ABS_TELEMETRY decoded at 1 kHz', 6, lambda: at_full_rate(windows))
        print(f"  ABS_TELEMETRY is a {row['Type']}, {row['Hz']} Hz")
        undecoded = [c for c, row in windows.channels().items() if c.startswith('ABS_') and row['Type'].startswith('??')]
        assert not undecoded, undecoded

        screen.click(*windows.place('ABS_TELEMETRY'), times=2)
        windows.until('the fields of ABS_TELEMETRY', 5, lambda: 'ABS_TELEMETRY' in windows.titles())
        screen.move('ABS_TELEMETRY', 0, 250)
        before, after = f'{folder}/before.png', f'{folder}/after.png'
        screen.tool('import', '-window', 'root', before)
        time.sleep(2)
        screen.tool('import', '-window', 'root', after)
        compared = subprocess.run(['compare', '-metric', 'AE', before, after, 'null:'], capture_output=True, text=True, timeout=30)
        changed = float(compared.stderr.split()[0])
        assert changed > 500, f'only {changed} pixels of the screen changed'
        print(f'  {changed:.0f} pixels changed')
        if picture:
            screen.tool('convert', after, '-crop', '800x650+0+0', '+repage', '-colors', '64', picture)

        run.wait(timeout=30)
        assert run.returncode == 0, run.stderr.read()
        screen.click(*windows.place('ABS_STATUS'), times=2)
        windows.until('the fields of ABS_STATUS', 5, lambda: 'ABS_STATUS' in windows.titles())
    finally:
        for process in (spy, run):
            if process is not None and process.poll() is None:
                process.terminate()
                process.wait(timeout=20)
    text = pathlib.Path(folder, 'spy.log').read_text()
    assert re.search(r'Found [1-9]\d* LCM types', text), text


def fails(environment, *words, arguments=(), status=3):
    """abs-spy in a bare environment ends with the status and a message that holds the words."""
    result = subprocess.run([ABS_SPY, *arguments], env=environment, capture_output=True, text=True, timeout=60)
    assert result.returncode == status, (environment, result)
    for word in words:
        assert word in result.stderr, (word, result.stderr)


def missing_pieces(screen, folder):
    shell = f'{folder}/bin'
    os.mkdir(shell)
    for tool in ('sh', 'dirname', 'realpath', 'cat'):
        os.symlink(shutil.which(tool), f'{shell}/{tool}')
    path = os.environ['PATH']
    fails({'PATH': shell, 'DISPLAY': screen.name}, 'no Java', 'apt-get install default-jre')
    fails({'PATH': path, 'JAVA_HOME': '/nowhere'}, 'no Java (/nowhere/bin/java)')
    fails({'PATH': path, 'LCM_JAR': '/nowhere/lcm.jar', 'DISPLAY': screen.name}, "LCM_JAR is '/nowhere/lcm.jar'")
    fails({'PATH': path}, 'DISPLAY is not set', 'abs_hil watch')
    fails({'PATH': path, 'DISPLAY': ':4321'}, ':4321', status=1)
    fails({'PATH': path, 'DISPLAY': screen.name}, "unknown option '--fast'", arguments=['--fast'], status=2)
    alone = f'{folder}/alone/bin/abs-spy'
    os.makedirs(os.path.dirname(alone))
    shutil.copy(ABS_SPY, alone)
    result = subprocess.run([alone], capture_output=True, text=True)
    assert result.returncode == 3 and 'abs_hil_types.jar is missing' in result.stderr, result
    print('missing pieces are named')


def kinds():
    """Name, environment and what the path of lcm.jar must hold, of every Java and LCM to try."""
    homes = sorted({os.path.realpath(home) for home in glob.glob('/usr/lib/jvm/*') if os.access(f'{home}/bin/java', os.X_OK)})
    found = [(f'Java {os.path.basename(home)}', {'JAVA_HOME': home}, '/lcm.jar') for home in homes]
    if os.path.exists(f'{os.path.dirname(LCM_PYTHON)}/lcm-spy'):
        found.append(("LCM of Python's package", {'PATH': os.path.dirname(LCM_PYTHON) + ':' + os.environ['PATH']},
                      '/site-packages/share/java/lcm.jar'))
    else:
        print(f'SKIPPED: a newer LCM: {LCM_PYTHON} is missing: scripts/setup_python.sh')
    return found or [('Java', {}, '/lcm.jar')]


def main():
    absent = [tool for tool in TOOLS if not shutil.which(tool)]
    if absent or not os.path.exists(PROBE_JAR):
        print('SKIPPED: ' + (f'{", ".join(absent)} not installed' if absent else 'built without Java')
              + ' (scripts/setup.sh packages-spy.txt)')
        sys.exit(77)
    if 'inside' not in sys.argv:
        os.execv(PRIVATE_NETWORK, [PRIVATE_NETWORK, sys.executable, *sys.argv, 'inside'])
    picture = PICTURE
    for name, environment, lcm_jar in kinds():
        with Screen() as screen, tempfile.TemporaryDirectory() as folder:
            print(name)
            watch_a_run(screen, folder, environment, lcm_jar, picture)
            picture = None
    with Screen() as screen, tempfile.TemporaryDirectory() as folder:
        missing_pieces(screen, folder)


if __name__ == '__main__':
    main()
