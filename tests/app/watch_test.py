"""abs_hil watch in a terminal of its own (a pty), on a run in a network namespace of its own: the plots move, silence and
a publisher that starts again are shown, garbage is counted, `q` quits, and the terminal is given back after `q`, SIGINT,
SIGTERM, SIGHUP and SIGQUIT. Without a terminal: --once, --plain.

usage: watch_test.py PROGRAM PRIVATE_NETWORK_SCRIPT PYTHON_MODULE_DIR     (77: no namespace to be had)
"""
import fcntl
import os
import pty
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time

from live import PATIENT

PROGRAM, PRIVATE_NETWORK, MODULE_DIR = map(os.path.abspath, sys.argv[1:4])
COLUMNS, ROWS = 90, 30


class Vt100:
    """The screen of a VT100 after the bytes sent to it; fails for an unknown sequence."""

    SEQUENCE = re.compile(rb'\x1b\[(\??[0-9;]*)([A-Za-z])|\x1b[()][A-Z0-9]|\x1b[=>78M]|[\x0e\x0f\x00]')

    def __init__(self):
        self.rows = [[' '] * COLUMNS for _ in range(ROWS)]
        self.row = self.column = 0
        self.rest = b''

    def feed(self, data):
        data = self.rest + data
        at = 0
        while at < len(data):
            match = self.SEQUENCE.match(data, at)
            if match:
                if match.group(2):
                    self.control(match.group(1).decode(), match.group(2).decode())
                at = match.end()
            elif data[at] == 0x1b:
                assert len(data) - at < 12, f'unknown sequence {data[at:at + 12]!r}'
                break  # the rest has not arrived yet
            elif data[at] in b'\r\n\b':
                self.column = {13: 0, 10: self.column, 8: max(self.column - 1, 0)}[data[at]]
                self.row = min(self.row + (data[at] == 10), ROWS - 1)
                at += 1
            else:
                size = next((s for lead, s in ((0xf0, 4), (0xe0, 3), (0xc0, 2)) if data[at] >= lead), 1)
                if at + size > len(data):
                    break
                character = data[at:at + size].decode()
                if '\u0300' <= character <= '\u036f':
                    self.rows[self.row][max(self.column - 1, 0)] += character
                else:
                    self.column = min(self.column, COLUMNS - 1)
                    self.rows[self.row][self.column] = character
                    self.column += 1
                at += size
        self.rest = data[at:]

    def control(self, parameters, final):
        numbers = [int(n) for n in parameters.lstrip('?').split(';') if n] or [0]
        step = max(numbers[0], 1)
        if final == 'H':
            self.row = min(step, ROWS) - 1
            self.column = min(max(numbers[1], 1) if len(numbers) > 1 else 1, COLUMNS) - 1
        elif final in 'ABCD':
            self.row = min(max(self.row + {'A': -step, 'B': step}.get(final, 0), 0), ROWS - 1)
            self.column = min(max(self.column + {'C': step, 'D': -step}.get(final, 0), 0), COLUMNS - 1)
        elif final in 'JK':
            here = self.rows[self.row]
            if numbers[0] == 1:
                here[:self.column + 1] = [' '] * (self.column + 1)
            else:
                here[self.column:] = [' '] * (COLUMNS - self.column)
                if final == 'J':
                    for row in self.rows[self.row + 1:]:
                        row[:] = [' '] * COLUMNS
        else:
            assert final in 'mhlr', f'unknown sequence ESC [ {parameters} {final}'

    def lines(self):
        return [''.join(row).rstrip() for row in self.rows]

    def text(self):
        return '\n'.join(self.lines())


class Watcher:
    """abs_hil watch on a pty."""

    def __init__(self, *arguments, term='vt100', locale='C.UTF-8', stderr_too=False):
        self.master, self.slave = pty.openpty()
        fcntl.ioctl(self.slave, termios.TIOCSWINSZ, struct.pack('HHHH', ROWS, COLUMNS, 0, 0))
        self.before = termios.tcgetattr(self.slave)
        self.bytes = b''
        self.screen = Vt100()
        self.known = term == 'vt100'
        self.process = subprocess.Popen([PROGRAM, 'watch', *arguments], stdin=self.slave, stdout=self.slave,
                                        stderr=self.slave if stderr_too else subprocess.PIPE, start_new_session=True,
                                        env={**os.environ, 'TERM': term, 'LC_ALL': locale})

    def read(self, seconds):
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and select.select([self.master], [], [], left)[0]:
            data = os.read(self.master, 65536)
            self.bytes += data
            if self.known:
                self.screen.feed(data)

    def until(self, pattern, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.read(0.1)
            if re.search(pattern, self.screen.text()):
                return
        raise AssertionError(f'{pattern!r} not within {seconds} s on\n{self.screen.text()}')

    def ends(self, status, drawn=True):
        """Waits for the end; the terminal must be restored."""
        for _ in range(100):
            if self.process.poll() is not None:
                break
            self.read(0.1)
        self.read(0.2)
        assert self.process.poll() == status, (self.process.poll(), status, self.process.stderr.read1())
        after = termios.tcgetattr(self.slave)
        assert after == self.before, 'the terminal is not as it was'
        if drawn and not self.known:  # xterm: the last sequences leave the other screen and show the cursor
            tail = self.bytes[-80:]
            assert b'\x1b[?1049l' in tail and b'\x1b[?25h' in self.bytes[-120:] + b'', tail
            assert self.bytes.count(b'\x1b[?1049h') == 1, 'one screen entered'
        os.close(self.master)
        os.close(self.slave)


def run(*arguments):
    return subprocess.Popen([PROGRAM, *PATIENT, '--no-out', *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def garbage():
    """Packets on our channels that are not messages: LCM's small-message header, a channel, and then garbage."""
    event = abs_hil.event_t()
    whole = event.encode()
    damaged = [b'', b'x', whole[:8], whole[:-3], whole[:32] + b'\xff\xff\xff\xff' + whole[36:], whole + b'more', os.urandom(300)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for number, payload in enumerate(damaged):
            for channel in (b'ABS_EVENT', b'ABS_TELEMETRY'):
                packet = struct.pack('>II', 0x4c433032, 70_000 + number) + channel + b'\0' + payload
                out.sendto(packet, ('239.255.76.67', 7667))
    return 2 * len(damaged)


def watched_run():
    watcher = Watcher()
    watcher.until('waiting for messages', 10)
    watcher.until('No message has arrived yet on ABS_TELEMETRY', 5)
    first = run()
    watcher.until(r'accelerate +[\d.]+ s +ω1 +[1-9]', 15)
    watcher.until(r'(9[5-9]\d|10[0-5]\d) messages/s', 8)
    before = watcher.screen.lines()
    assert any('\u2800' < c < '\u28ff' for c in watcher.screen.text()), watcher.screen.text()
    watcher.read(1.0)
    after = watcher.screen.lines()
    moved = [row for row in range(2, 20) if before[row] != after[row] and re.search('[\u2801-\u28ff]', after[row])]
    assert moved, 'no plot moved within a second:\n' + watcher.screen.text()
    watcher.until(r'wake-up \d+/\d+/\d+/\d+ cycle', 5)
    watcher.until(r'paper · adaptive · paper-table1 · sim', 5)
    sent = garbage()
    watcher.until(rf'malformed {sent}\b', 5)
    watcher.until(r'brake +[\d.]+ s .*θ̂ +2\d\.', 15)
    first.wait(timeout=30)
    watcher.until(r'run ended, no messages for [2-9]\.\d s', 10)
    second = run()
    watcher.until(r'run 2 seen here', 15)
    watcher.until(r'accelerate +[\d.]+ s', 10)
    second.kill()
    second.wait()
    watcher.until(r'  no messages for [2-9]\.\d s', 10)
    assert 'lost on the way 0' in watcher.screen.text(), watcher.screen.text()
    os.write(watcher.master, b'q')
    watcher.ends(0)
    print('moving plots, garbage, silence, another run, q')


def given_back():
    for name, status in (('SIGINT', 130), ('SIGTERM', 143), ('SIGHUP', 143), ('SIGQUIT', 131)):
        watcher = Watcher(term='xterm-256color')
        for _ in range(100):
            watcher.read(0.1)
            if b'No message has arrived' in watcher.bytes:
                break
        watcher.process.send_signal(getattr(signal, name))
        watcher.ends(status)
    print('the terminal is given back after every signal')


def odd_terminals():
    watcher = Watcher(locale='C')
    watcher.until('No message has arrived', 10)
    running = run('--set', 'experiment.start_speed_rad_s=120')
    watcher.until(r'w1 +\d+\.\d.*\n.*slip +\* slip', 15)
    assert watcher.screen.text().isascii(), watcher.screen.text()
    running.wait(timeout=30)
    fcntl.ioctl(watcher.slave, termios.TIOCSWINSZ, struct.pack('HHHH', 5, 20, 0, 0))
    watcher.process.send_signal(signal.SIGWINCH)
    watcher.read(0.5)
    os.write(watcher.master, b'xyzQ')
    watcher.ends(0)
    watcher = Watcher(term='dumb')
    watcher.known = True
    watcher.until('waiting for messages\n', 10)
    assert b'\x1b' not in watcher.bytes, watcher.bytes
    watcher.process.send_signal(signal.SIGINT)
    watcher.ends(130, drawn=False)
    print('ASCII, a small window, a terminal that cannot place text')


class TcpqServer:
    """One subscriber's end of LCM's tcpq server: the first subscriber gets a message and is disconnected, later ones get
    nothing."""

    def __init__(self):
        self.subscribed = 0
        self.socket = socket.create_server(('127.0.0.1', 7700))
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            connection, _ = self.socket.accept()
            threading.Thread(target=self.answer, args=(connection,), daemon=True).start()

    def answer(self, connection):
        with connection:
            connection.recv(8)
            connection.sendall(struct.pack('>II', 0x287617fa, 0x0100))
            if not connection.recv(4096):
                return  # the client only checked for a server
            self.subscribed += 1
            if self.subscribed == 1:
                message = abs_hil.telemetry_t()
                message.phase = message.PHASE_ACCELERATE
                data, channel = message.encode(), b'ABS_TELEMETRY'
                connection.sendall(struct.pack('>II', 1, len(channel)) + channel + struct.pack('>I', len(data)) + data)
                time.sleep(0.5)
                return
            while connection.recv(4096):
                pass


def tcpq_server_comes_and_goes():
    server = TcpqServer()
    watcher = Watcher('--lcm-url', 'tcpq://127.0.0.1:7700', stderr_too=True)
    watcher.until('accelerate', 10)
    for _ in range(100):
        watcher.read(0.1)
        if server.subscribed == 2:
            break
    assert server.subscribed == 2, 'the watcher has not found the server again'
    watcher.until(r'no messages for [2-9]\.\d s', 10)
    assert 'LCM' not in watcher.screen.text(), watcher.screen.text()
    os.write(watcher.master, b'q')
    watcher.ends(0)
    print('a tcpq server that hangs up is found again, and says nothing in the picture')


def without_terminal():
    def watch(*arguments, **options):
        return subprocess.run([PROGRAM, 'watch', *arguments], capture_output=True, text=True, timeout=60, **options)

    nothing = watch('--once', '--timeout', '0.5')
    assert nothing.returncode == 3 and 'no message arrived within 0.5 s on ABS_TELEMETRY' in nothing.stderr, nothing
    running = run()
    time.sleep(1)
    picture = watch('--once', '--ascii')
    assert picture.returncode == 0 and re.search(r'[5-9]\d\d messages/s|1\d\d\d messages/s', picture.stdout), picture
    assert picture.stdout.isascii() and '****' in picture.stdout and len(picture.stdout.splitlines()) == 32, picture.stdout
    plain = subprocess.Popen([PROGRAM, 'watch', '--plain'], stdout=subprocess.PIPE, text=True)
    lines = [plain.stdout.readline() for _ in range(3)]
    plain.send_signal(signal.SIGTERM)
    assert plain.wait(timeout=10) == 143
    times = [float(re.match(r'\w+ +([\d.]+) s', line).group(1)) for line in lines[1:]]
    assert times[0] < times[1], lines
    running.kill()
    running.wait()
    for arguments, words in ((['--window', '0'], '[1, 60]'), (['--lcm-url', 'nonsense'], 'nonsense'),
                             (['--prefix', 'a.*'], "'a.*'"), (['--timeout', '2'], '--once')):
        refused = watch('--plain', *arguments)
        assert refused.returncode == 2 and words in refused.stderr, (arguments, refused)
    alone = subprocess.run(['unshare', '-n', PROGRAM, 'watch', '--once'], capture_output=True, text=True, timeout=30)
    assert alone.returncode == 3 and 'ip route add 224.0.0.0/4 dev lo' in alone.stderr, alone
    print('--once, --plain, bad input, no route')


def main():
    if 'inside' not in sys.argv:
        os.execv(PRIVATE_NETWORK, [PRIVATE_NETWORK, sys.executable, *sys.argv, 'inside'])
    sys.path.insert(0, MODULE_DIR)
    global abs_hil
    import abs_hil
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # a crash may leave a core file here
        watched_run()
        given_back()
        odd_terminals()
        tcpq_server_comes_and_goes()
        without_terminal()


if __name__ == '__main__':
    main()
