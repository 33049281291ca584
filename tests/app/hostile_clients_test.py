"""The resident guard under clients that mean harm, and foreign duties while no run is covered. Times are by the card's
clock, or count the guard's own looks; this computer's own pauses reach tens of ms, so a bound holds for nine tries of
ten here (tests/vm asserts them all).

usage: hostile_clients_test.py ABS_HIL [TRIES]
"""
import array
import contextlib
import ctypes
import fcntl
import mmap
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

A_FEW = 5  # foreign duties; many in a row count as a holder that drives without being watched, which is ended
TRIES = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 5

from program import PROGRAM  # noqa: E402
from resident_guardian import GUARDIAN, ResidentTest, SAFE, connect, not_held_up, settings, wait_until  # noqa: E402
from rig_emulator import skip_unless_possible  # noqa: E402

MAGIC = 0x6C656132
ASK, GRANTED, REFUSED, COVER, READY, STATE, MAKE_SAFE, ANSWER = range(1, 9)
HEADER = struct.Struct('<IIiBBBB')
PWM_INDEX, PWM_WIDTH = 0x60, 0x6C
F_ADD_SEALS, F_SEAL_SHRINK = 1033, 2
libc = ctypes.CDLL(None, use_errno=True)


def send(client, word, text=b'', files=()):
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array('i', files))] if files else []
    client.sendmsg([HEADER.pack(MAGIC, word, 0, 0, 0, 0, 0) + text], rights)


def receive(client):
    data, rights, _, _ = client.recvmsg(70000, socket.CMSG_SPACE(4 * 4))
    files = array.array('i')
    for _, _, part in rights:
        files.frombytes(part[:len(part) - len(part) % files.itemsize])
    return HEADER.unpack(data[:HEADER.size])[1], data[HEADER.size:].decode(), list(files)


def ask(service, emulator):
    """A lease for this very process."""
    client = connect(service.socket)
    send(client, ASK, f'pci, root {emulator.root}, bdf the only one'.encode(), [os.pidfd_open(os.getpid())])
    word, text, files = receive(client)
    assert word == GRANTED, text
    return client, files


@contextlib.contextmanager
def lease(service, emulator):
    """For this very process, which the guard ends if it holds one for 10 s without a run."""
    client, files = ask(service, emulator)
    ended = service.said().count('lease ended')
    try:
        yield client, files
    finally:
        client.close()
        for file in files:
            os.close(file)
        wait_until(lambda: service.said().count('lease ended') > ended, 'the lease did not end')


def enough(measure):
    """The times of `measure`, repeated until there are at least TRIES."""
    times = []
    while len(times) < TRIES:
        times += measure()
    return times


class ForeignWriter:
    """Another process with a handle on the card. The service ends it in the end; then there is a new one."""
    PROGRAM = f"""
import os, struct, sys, time
card = os.open(sys.argv[1], os.O_RDWR)
for line in sys.stdin:
    print(time.monotonic_ns(), flush=True)
    for offset, value in zip(({PWM_INDEX}, {PWM_WIDTH}), map(int, line.split())):
        os.pwrite(card, struct.pack('<I', value), offset)
    print('written', flush=True)
"""

    def __init__(self, emulator):
        self.card = next(emulator.root.glob('*/resource2'))
        self.process = None

    def write(self, pwm, width):
        """When it wrote, by its own clock."""
        while True:
            if self.process is None or self.process.poll() is not None:
                self.process = subprocess.Popen([sys.executable, '-c', self.PROGRAM, self.card], text=True, bufsize=1,
                                                stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            with contextlib.suppress(BrokenPipeError):
                self.process.stdin.write(f'{pwm} {width}\n')
                began, written = self.process.stdout.readline(), self.process.stdout.readline()
                if written:
                    return int(began)
            self.process.wait()

    def __del__(self):
        if self.process is not None:
            self.process.kill()
            self.process.communicate()


class HostileTest(ResidentTest):
    timeout_ms = 500

    def foreign_duty(self, emulator, writer, pwm=0):
        """ms until it is gone, by the card's clock."""
        with not_held_up():
            before_ns = writer.write(pwm, 3000)
        wait_until(lambda: emulator.widths().zero_since_ns is not None, 'a foreign duty stays on')
        return max(0, emulator.widths().zero_since_ns - before_ns) * 1e-6

    def hold(self, measure, what, bound_ms):
        """Nine of ten times are within the bound. Measured again if not: this computer's own pauses pass, a guard that
        is held up stays so."""
        for _ in range(3):
            times = sorted(measure())
            print(f'{what}: ms, worst {times[-1]:.1f}, median {times[len(times) // 2]:.1f} of {len(times)}', flush=True)
            if times[(9 * len(times) - 1) // 10] <= bound_ms:
                return
        self.fail(f'{what}: more than {bound_ms} ms in three measurements, the last {times}')

    def longest_pause(self, page, work):
        """Longest time without a look of the guard, ms, while `work` goes on. A process of its own watches: a thread
        would wait for this interpreter's lock."""
        reader, writer = os.pipe()
        done = mmap.mmap(-1, 1)
        watcher = os.fork()
        if watcher == 0:
            with not_held_up():
                worst, seen, since = 0.0, None, time.monotonic()
                while not done[0]:
                    now, beats = time.monotonic(), struct.unpack_from('<Q', page)[0]
                    if beats != seen:
                        seen, since = beats, now
                    worst = max(worst, (now - since) * 1e3)
                    time.sleep(0.0005)
                os.write(writer, struct.pack('d', worst))
            os._exit(0)
        try:
            work()
        finally:
            done[0] = 1
            worst = struct.unpack('d', os.read(reader, 8))[0]
            os.waitpid(watcher, 0)
            os.close(reader)
            os.close(writer)
        return worst


class ZeroUnlessCovered(HostileTest):
    def test_foreign_duties_before_a_lease_before_the_cover_and_after_the_end(self):
        emulator = self.emulator()
        service = self.service(emulator)
        writer = ForeignWriter(emulator)

        def no_lease():
            return [self.foreign_duty(emulator, writer, n % 2) for n in range(2 * TRIES)]

        def granted():
            with lease(service, emulator):
                return [self.foreign_duty(emulator, writer, pwm) for pwm in (0, 1)]
        for what, measure in (('without a lease', no_lease), ('granted, not covered', lambda: enough(granted)),
                              ('after a lease', no_lease)):
            self.hold(measure, f'foreign duty {what}', 20)

    def test_foreign_duty_while_commission_asks_a_person_to_turn_a_wheel(self):
        self.hold(lambda: enough(self.duties_while_commission_asks), 'foreign duty while commission waits for a person', 20)

    def duties_while_commission_asks(self):
        emulator = self.emulator()
        service = self.service(emulator)
        writer = ForeignWriter(emulator)
        program = subprocess.Popen(
            [pathlib.Path(PROGRAM).resolve(), 'commission', *settings(
                f'driver.pci.root={emulator.root}', 'guardian.resident=require',
                f'guardian.socket={service.socket}', 'guardian.timeout_ms=1000')],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, bufsize=1)
        self._programs.append(program)
        while line := program.stdout.readline():
            if '[y/N]' in line:
                program.stdin.write('y\n')
            elif line.startswith('Turn the '):
                break
        times = [self.foreign_duty(emulator, writer) for _ in range(A_FEW)]
        self.assertIsNone(program.poll(), 'commission was ended by single foreign duties')
        program.kill()
        service.end()
        return times

    def test_holder_that_stops_before_the_cover_is_ended(self):
        self.hold(lambda: enough(self.duties_while_the_holder_is_stopped), 'foreign duty, holder stopped', 20)

    def duties_while_the_holder_is_stopped(self):
        emulator = self.emulator()
        service = self.service(emulator)
        script = ('import os, signal, sys; sys.path.insert(0, sys.argv.pop(1)); '
                  'import hostile_clients_test as h, pathlib, types; '
                  'lease = h.ask(types.SimpleNamespace(socket=sys.argv[1]), types.SimpleNamespace(root=sys.argv[2])); '
                  'os.kill(os.getpid(), signal.SIGSTOP)')
        holder = subprocess.Popen([sys.executable, '-c', script, pathlib.Path(__file__).parent, PROGRAM, service.socket,
                                   emulator.root])
        self.addCleanup(holder.kill)
        wait_until(lambda: 'lease granted' in service.said(), 'no lease')
        writer = ForeignWriter(emulator)
        times = [self.foreign_duty(emulator, writer) for _ in range(A_FEW)]
        self.assertEqual(holder.wait(timeout=30), -signal.SIGKILL)
        wait_until(lambda: 'it did not have a run covered in time' in service.said(), 'not said')
        service.end()
        return times

    def test_foreign_duty_between_the_cover_and_the_first_cycle(self):
        self.hold(lambda: enough(self.duties_before_the_first_cycle), 'foreign duty, covered and not cycling', 20)

    def duties_before_the_first_cycle(self):
        """Of a run that begins 0.9 s after a whole second, and is covered from 0.4 s on."""
        emulator = self.emulator()
        service = self.service(emulator)
        writer = ForeignWriter(emulator)
        time.sleep(-time.monotonic() % 1)
        begins = round(time.monotonic()) + 1.9
        program = subprocess.Popen(
            [pathlib.Path(PROGRAM).resolve(), 'latency', '--backend', 'rig', '--duration', '0.1', '--secaligned', '900000',
             *settings(f'driver.pci.root={emulator.root}', 'guardian.resident=require', f'guardian.socket={service.socket}',
                       'guardian.timeout_ms=500')], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self._programs.append(program)
        wait_until(lambda: 'lease granted' in service.said(), 'no lease')
        self.assertLess(time.monotonic(), begins - 1, 'this computer is too slow')
        times = []
        for before_s in (0.4, 0.3, 0.2):
            time.sleep(max(0, begins - before_s - time.monotonic()))
            times.append(self.foreign_duty(emulator, writer))
            self.assertLess(time.monotonic(), begins)
        program.wait(timeout=20)
        service.end()
        return times

    def test_service_writes_zeros_first(self):
        """Before its socket, its companions and its log."""
        emulator = self.emulator()
        writer = ForeignWriter(emulator)

        def start():
            before_ns = writer.write(0, 3000)
            self.service(emulator)
            zero_after_ns = emulator.widths().zero_since_ns - before_ns
            self.services[-1].end()
            self.assertGreater(zero_after_ns, 0)
            return zero_after_ns * 1e-6
        self.hold(lambda: [start() for _ in range(TRIES)], 'start of the service to zeros, fork and exec included', 20)


class ForeignWriters(HostileTest):
    DRIVES = f"""
import os, signal, struct, sys, time
manner = sys.argv[2]
if manner == 'stubborn':
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
card = os.open(sys.argv[1], os.O_RDWR)
while True:
    for offset, value in (({PWM_INDEX}, 0), ({PWM_WIDTH}, 3000)):
        os.pwrite(card, struct.pack('<I', value), offset)
    time.sleep(0.0001 if manner == 'eager' else 0.001)
"""

    def time_on(self, manner, ended_by):
        """ms, by the card's clock."""
        emulator = self.emulator()
        service = self.service(emulator)
        log = self.folder / 'changes'
        emulator.command(f'changes {log}')
        writer = subprocess.Popen([sys.executable, '-c', self.DRIVES, next(emulator.root.glob('*/resource2')), manner])
        try:
            self.assertEqual(writer.wait(timeout=20), ended_by)
        finally:
            writer.kill()
        wait_until(lambda: f'process {writer.pid} (' in service.said(), 'not said')
        self.assertIn('drove the board without being guarded, and was ended', service.said())
        wait_until(lambda: emulator.wire() == SAFE, 'the board stays on')
        emulator.command('changes off')
        rows = [tuple(map(float, line.split())) for line in log.read_text().splitlines()]
        on_ns = sum(after[0] - row[0] for row, after in zip(rows, rows[1:]) if any(row[1:]))
        self.assertGreater(on_ns, 0)
        service.end()
        emulator.end()
        return on_ns * 1e-6

    def test_a_foreign_writer_is_found_and_ended(self):
        for manner, ended_by in (('mild', -signal.SIGTERM), ('eager', -signal.SIGTERM), ('stubborn', -signal.SIGKILL)):
            self.hold(lambda manner=manner, ended_by=ended_by: [self.time_on(manner, ended_by) for _ in range(TRIES)],
                      f'{manner} foreign writer, on in all', 100)

    def test_a_holder_is_suspected_last(self):
        emulator = self.emulator()
        service = self.service(emulator)
        with lease(service, emulator) as (client, _):
            open_card = os.open(next(emulator.root.glob('*/resource2')), os.O_RDWR)
            writer = ForeignWriter(emulator)
            while 'and was ended' not in service.said():
                self.foreign_duty(emulator, writer)
                time.sleep(0.02)  # many in a row count as the holder's
            os.close(open_card)
        self.assertNotRegex(service.said(), rf'process {os.getpid()} \S+ drove')


class HostileClients(HostileTest):
    def attacks(self, service):
        """Each is something a member of the group abs_hil could do to the talker."""
        def messages():
            with connect(service.socket) as client:
                for _ in range(100_000):
                    try:
                        send(client, STATE)
                    except OSError:
                        break

        def connections():
            with contextlib.ExitStack() as all_of_them:
                for _ in range(1000):
                    client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                    all_of_them.enter_context(client)
                    client.settimeout(1)
                    with contextlib.suppress(OSError):
                        client.connect(str(service.socket))

        def huge_memory():
            huge = os.memfd_create('huge', os.MFD_ALLOW_SEALING)
            os.ftruncate(huge, 6 << 30)
            fcntl.fcntl(huge, F_ADD_SEALS, F_SEAL_SHRINK)
            with connect(service.socket) as client:
                send(client, COVER, b'', [huge, huge])
            send(self.holder, COVER, b'', [huge, huge])
            os.close(huge)

        def nested_json():
            deep = os.memfd_create('deep')
            os.write(deep, b'[' * (8 << 20))
            send(self.holder, COVER, b'', [deep, deep])
            os.close(deep)

        def blocking_close():
            """Of a descriptor with unsent data and nobody who reads: the talker waits in close() for a second."""
            with socket.create_server(('127.0.0.1', 0)) as server:
                lingers = socket.create_connection(server.getsockname())
                lingers.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 1))
                lingers.setblocking(False)
                with contextlib.suppress(BlockingIOError):
                    while True:
                        lingers.send(bytes(65536))
                begin = time.monotonic()
                with connect(service.socket) as client:
                    send(client, ASK, b'a board', [lingers.fileno()])
                    lingers.close()
                    receive(client)  # the refusal
                with connect(service.socket) as client:
                    send(client, STATE)
                    receive(client)
                self.assertGreater(time.monotonic() - begin, 0.5, 'the talker did not wait')

        def garbage():
            with connect(service.socket) as client, contextlib.suppress(OSError):
                for n in range(1000):
                    client.send(os.urandom(n % 200 + 1))
        return messages, connections, huge_memory, nested_json, blocking_close, garbage

    def test_guard_looks_on(self):
        emulator = self.emulator()
        service = self.service(emulator)

        def pause(attack):
            with lease(service, emulator) as (self.holder, files):
                with self.assertRaises(PermissionError):
                    mmap.mmap(files[1], 0, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE)
                with mmap.mmap(files[1], 0, mmap.MAP_SHARED, mmap.PROT_READ) as page:
                    return self.longest_pause(page, attack)
        for attack in self.attacks(service):
            # 5 ms from look to look; the rest is this computer's.
            self.hold(lambda attack=attack: [pause(attack) for _ in range(TRIES)],
                      f'longest time without a look under {attack.__name__}', 10)
        writer = ForeignWriter(emulator)
        self.foreign_duty(emulator, writer)
        self.assertIsNone(service.process.poll())

    def test_a_flood_of_requests_for_zeros(self):
        """Each makes the talker ask the guard for a look at the board."""
        emulator = self.emulator()
        service = self.service(emulator)
        request = f'pci, root {emulator.root}, bdf the only one'.encode()
        flooding = os.fork()
        if flooding == 0:
            visitors = [connect(service.socket) for _ in range(20)]
            for visitor in visitors:
                visitor.setblocking(False)
            while True:
                for visitor in visitors:
                    with contextlib.suppress(OSError):
                        send(visitor, MAKE_SAFE, request)
        try:
            writer = ForeignWriter(emulator)
            self.hold(lambda: [self.foreign_duty(emulator, writer, n % 2) for n in range(4 * TRIES)],
                      'foreign duty under a flood of requests for zeros', 20)
        finally:
            os.kill(flooding, signal.SIGKILL)
            os.waitpid(flooding, 0)
        self.assertIsNone(service.process.poll())

    def test_talker_that_hangs_or_dies_leaves_the_run_alone(self):
        emulator = self.emulator()
        for number in (signal.SIGKILL, signal.SIGSTOP):
            with self.subTest(number.name):
                service = self.service(emulator)
                program = self.start(emulator, experiment=('experiment.cut_speed_rad_s=60', 'experiment.end_speed_m_s=1.5'))
                self.wait_until_driven(emulator, program)
                children = pathlib.Path(f'/proc/{service.process.pid}/task/{service.process.pid}/children').read_text()
                talker = int(children.split()[1])  # the standby was started first
                os.kill(talker, number)
                _, words = program.communicate(timeout=30)
                self.assertEqual(program.returncode, 0, words + service.said())
                self.assertEqual(emulator.wire(), SAFE)
                if number == signal.SIGKILL:
                    self.assertEqual(self.start(emulator).wait(timeout=30), 0)  # a new talker grants again
                service.end()

    def test_foreign_duties_while_a_talker_is_replaced(self):
        """The guard forks for each new talker."""
        emulator = self.emulator()
        service = self.service(emulator)
        writer = ForeignWriter(emulator)
        children = pathlib.Path(f'/proc/{service.process.pid}/task/{service.process.pid}/children')

        def longest_duty():
            wait_until(lambda: len(children.read_text().split()) == 2, 'no talker')
            old = children.read_text().split()
            os.kill(int(old[-1]), signal.SIGKILL)  # the standby was started first
            times = []
            while children.read_text().split() in (old, old[:1]):
                times.append(self.foreign_duty(emulator, writer))
            return max([*times, self.foreign_duty(emulator, writer)])
        self.hold(lambda: [longest_duty() for _ in range(TRIES)], 'foreign duty while a talker is replaced', 20)
        self.assertIsNone(service.process.poll())

    def test_a_client_s_words_write_no_line_of_the_log(self):
        emulator = self.emulator()
        service = self.service(emulator)
        forged = 'abs_guardian: ended; drive 0 and brake 0 written and read back'
        with connect(service.socket) as client:
            send(client, ASK, f'pci\n{forged}\x1b[2J'.encode(), [os.pidfd_open(os.getpid())])
            self.assertEqual(receive(client)[0], REFUSED)
        client, _ = ask(service, emulator)
        with client, open(os.memfd_create('terms'), 'w+') as terms:
            terms.write(f'{{"board": "x\\n{forged}"}}')
            terms.flush()
            send(client, COVER, files=[terms.fileno(), terms.fileno()])
            self.assertEqual(receive(client)[0], REFUSED)
        wait_until(lambda: 'does not guard' in service.said(), 'nothing said')
        self.assertIn(forged, service.said())  # within a line
        self.assertFalse([line for line in service.said().splitlines() if line.startswith(forged)])
        self.assertNotIn('\x1b', service.said())

    def test_clients_cannot_fill_the_log(self):
        emulator = self.emulator()
        service = self.service(emulator)
        began = time.monotonic()
        for _ in range(2500):  # each refusal is a line of the log
            with connect(service.socket) as client:
                send(client, ASK, b'another board', [os.pidfd_open(os.getpid())])
                receive(client)
        lines = service.said().count('refused a lease')
        self.assertGreaterEqual(lines, 1000)
        self.assertLessEqual(lines, 2000 + time.monotonic() - began)

        def left_out():
            with connect(service.socket) as client:
                send(client, ASK, b'another board', [os.pidfd_open(os.getpid())])
                receive(client)
            return 'left out ' in service.said()
        wait_until(left_out, 'it does not say how many lines it left out')

    def test_full_log_holds_nobody_up(self):
        """Nobody reads the pipe that is the service's stderr."""
        emulator = self.emulator()
        reader, writer = os.pipe()
        fcntl.fcntl(writer, 1031, 4096)  # F_SETPIPE_SZ
        service_socket = self.folder / 'guardian.sock'
        process = subprocess.Popen([GUARDIAN, 'serve', '--socket', service_socket, *settings(
            f'driver.pci.root={emulator.root}')], stderr=writer, stdout=subprocess.DEVNULL)
        try:
            wait_until(service_socket.exists, 'no service')
            for _ in range(300):  # each refusal is a line of the log
                with contextlib.suppress(OSError), connect(service_socket) as client:
                    client.settimeout(0.05)
                    send(client, ASK, b'another board', [os.pidfd_open(os.getpid())])
                    client.recv(1000)
            self.hold(lambda: [self.foreign_duty(emulator, ForeignWriter(emulator)) for _ in range(2 * TRIES)],
                      'foreign duty, log full', 20)
            process.terminate()
            self.assertEqual(process.wait(timeout=20), 0)
        finally:
            process.kill()
            os.close(reader)
            os.close(writer)


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
