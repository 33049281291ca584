"""Commands to a running abs_hil over UDP multicast, in a network namespace of its own: each taken, refused with its
reason, or shrugged off; stop within two cycles. Status 77 where no namespace can be made.

usage: commands_test.py PROGRAM PRIVATE_NETWORK_SCRIPT PYTHON_MODULE_DIR [stop]
  stop  stop alone, each try within two cycles, for a clock that stands still for nobody else's work (tests/vm); else
        their median is
"""
import hashlib
import hmac
import json
import os
import pathlib
import random
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import time

from live import PATIENT

GROUP, PORT = '239.255.76.67', 7667
SHORT, LONG = 0x4C433032, 0x4C433033  # LCM's packets: whole messages, fragments
CYCLE_NS = 1_000_000


class Wire:
    """LCM's multicast protocol by hand, so that the test can send any packet."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        self.number = 0

    def raw(self, data):
        try:
            self.socket.sendto(data, (GROUP, PORT))
        except OSError:
            pass  # the buffer is full: the flood has its highest speed

    def message(self, channel, data):
        self.number += 1
        self.raw(struct.pack('>II', SHORT, self.number) + channel + b'\0' + data)

    def fragment(self, size, offset, number, count, data):
        self.number += 1
        self.raw(struct.pack('>IIIIHH', LONG, self.number, size, offset, number, count) + data)


class Ear:
    """Receives all traffic on LCM's multicast from now on."""

    def __init__(self):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        self.socket.bind((GROUP, PORT))
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, struct.pack('=4sI', socket.inet_aton(GROUP), 0))

    def heard(self, channel, silence_s):
        """The messages on a channel, until no message has arrived for the given time."""
        self.socket.settimeout(silence_s)
        while True:
            try:
                packet = self.socket.recv(65536)
            except TimeoutError:
                return
            name, _, data = packet[8:].partition(b'\0')
            if struct.unpack('>I', packet[:4])[0] == SHORT and name == channel.encode():
                yield abs_hil.decode(data)


def signed(key, session, sequence, command, name='', value=0.0):
    message = abs_hil.command_t()
    message.session, message.sequence, message.sender = session, sequence, 'wire'
    message.command, message.name, message.value, message.mac = command, name, value, ''
    message.mac = hmac.new(key.encode(), message.encode(), hashlib.sha256).hexdigest()
    return message.encode()


def events_of(path):
    """(channel, message) of every message in an event log."""
    data, at, found = path.read_bytes(), 0, []
    while at + 28 <= len(data):
        _, _, _, channel_size, size = struct.unpack_from('>IqqII', data, at)
        at += 28 + channel_size + size
        if at <= len(data):
            found.append((data[at - size - channel_size:at - size].decode(), abs_hil.decode(data[at - size:at])))
    return found


class Run:
    def __init__(self, folder, *options):
        self.log = pathlib.Path(folder, f'{time.monotonic_ns()}.lcmlog')
        self.process = subprocess.Popen([PROGRAM, *PATIENT, '--log', self.log, *options], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        time.sleep(1.5)

    def wait_for_cycles(self):
        """Waits until the run is under way, however long the program takes to start. In a virtual machine's virtual time no
        deadline would do: while the guest waits for the host's files, its clock runs ahead."""
        while not self.log.exists() or b'ABS_TELEMETRY' not in self.log.read_bytes():
            if self.process.poll() is not None:
                sys.exit(f'FAILED: the run ended before its first cycle: {self.process.communicate()}')
            time.sleep(0.05)

    def end(self):
        self.output = self.process.communicate(timeout=60)
        self.messages = events_of(self.log)
        self.answers = [m for c, m in self.messages if c == 'ABS_EVENT' and m.kind == 'command']
        return self.process.returncode


def send(*words):
    result = subprocess.run([PROGRAM, 'send', *KEY, *words], capture_output=True, text=True, timeout=30)
    return result.returncode, result.stdout + result.stderr


def check(holds, what, *shown):
    if not holds:
        sys.exit(f'FAILED: {what}: {shown}')
    print(f'ok: {what}', flush=True)


def live_changes(folder, key):
    run = Run(folder, '--wait-for-start', '--set', 'commands.enabled=true', *KEY)
    for words, status, text in [(('slip-ref', '0.12'), 0, 'control.slip_ref = 0.12'), (('gain', 'ka1', '2'), 0, 'ka1 = 2'),
                                (('gain', 'control.adaptive.gamma', '30'), 0, 'gamma = 30'),
                                (('slip-ref', '1.5'), 1, '(0, 1)'), (('gain', 'gamma', '-1'), 1, '[1e-06, 10000]'),
                                (('gain', 'control.rate_Hz', '100'), 1, 'cannot be changed'),
                                (('gain', 'nosuch', '1'), 1, 'unknown key'), (('gain', 'zeta0', '1'), 1, 'cannot be changed')]:
        found, said = send(*words)
        check(found == status and text in said and 'not authenticated' not in said, f'send {" ".join(words)}', found, said)
    # A recorded message cannot be used again, neither forged nor changed.
    state = [m for c, m in events_of(run.log) if c == 'ABS_COMMAND_STATE'][-1]
    wire, good = Wire(), signed(key, state.session, state.last_sequence + 1000, 'slip-ref', value=0.2)
    wire.message(b'ABS_COMMAND', good)
    wire.message(b'ABS_COMMAND', good)
    wire.message(b'ABS_COMMAND', signed('another key 0123456789', state.session, 1 << 40, 'slip-ref', value=0.3))
    wire.message(b'ABS_COMMAND', signed(key, '0' * 32, 1 << 41, 'slip-ref', value=0.3))
    time.sleep(0.3)
    forged_states(wire, state.session)
    started = time.monotonic()
    check(send('start')[0] == 0, 'send start')
    check(send('start')[0] == 1, 'a second start is refused')
    time.sleep(max(0.0, started + 6.6 - time.monotonic()))  # the wheels brake from 6.2 to 8.5 s after the start
    found, said = send('gain', 'ka1', '3')
    check(found == 0, 'a gain changes during the run', said)
    check(run.end() == 0, 'the run goes to its end', run.output)
    reasons = [m.reason for m in run.answers if 'wire' in m.message]
    check(reasons == [42, 41, 42, 38] or sorted(reasons) == [38, 41, 42, 42], 'repeated, forged, of another session',
          reasons)
    check(subprocess.run([PROGRAM, 'replay', run.log, '--check']).returncode == 0, 'replay reproduces the changed run')
    refs = {m.slip_ref for c, m in run.messages if c == 'ABS_TELEMETRY' and m.phase == m.PHASE_BRAKE}
    check(refs == {0.2}, 'the slip reference was followed', refs)


def forged_states(wire, session):
    """A state that a forger sends beside the run's does not end the sending."""
    for enabled, last_sequence in ((False, 0), (True, -1), (True, (1 << 63) - 1)):
        state = abs_hil.command_state_t()
        state.session, state.enabled, state.last_sequence = session, enabled, last_sequence
        sender = subprocess.Popen([PROGRAM, 'send', *KEY, 'gain', 'ka1', '2.5'], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True)
        while sender.poll() is None:
            wire.message(b'ABS_COMMAND_STATE', state.encode())
            time.sleep(0.02)
        check(sender.returncode == 0, 'a forged state does not end the sending', *sender.communicate())


def not_enabled(folder):
    run = Run(folder)
    found, said = send('slip-ref', '0.2')
    check(found == 3 and 'commands.enabled' in said, 'commands are off unless enabled', found, said)
    stop = subprocess.run([PROGRAM, 'send', 'stop'], capture_output=True, text=True, timeout=30)
    check(stop.returncode == 1 and 'stop accepted' in stop.stdout and 'not authenticated' in stop.stderr, 'stop needs no key',
          stop)
    check(run.end() == 1, 'stop ends the run')
    found, said = send('--timeout', '0.5', 'stop')
    check(found == 3 and 'no answer' in said, 'send reports that no run answers', found, said)


def forged():
    """A forger in place of a run answers each stop, with no tag or with the tag of another answer."""
    ear, wire, words = Ear(), Wire(), [PROGRAM, 'send', 'stop', '--timeout', '2']
    for tag in ('', f' [mac {"0" * 64}]'):
        for key, status, text in (([], 1, 'not authenticated'), (KEY, 3, 'no authentic answer')):
            sender = subprocess.Popen([*words, *key], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            stop = next(ear.heard('ABS_COMMAND', 5))
            answer = abs_hil.event_t()
            answer.kind, answer.reason, answer.message = 'command', 34, f"stop accepted \x1b[2J (sender '{stop.sender}'){tag}"
            wire.message(b'ABS_EVENT', answer.encode())
            said = ''.join(sender.communicate(timeout=30))
            check(sender.returncode == status and text in said and '\x1b' not in said, f'a forged answer {"with" if key else "without"} a key', said)
            list(ear.heard('ABS_COMMAND', 0.2))  # the repeated ones


def run_ends_meanwhile():
    """A simulated run of this test that ends between a command and its answer."""
    ears = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    ears.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    ears.bind((GROUP, PORT))
    ears.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + socket.inet_aton('0.0.0.0'))
    ears.settimeout(0.05)
    wire, state = Wire(), abs_hil.command_state_t()
    state.enabled, state.session = True, 'f' * 32
    sender = subprocess.Popen([PROGRAM, 'send', *KEY, '--timeout', '30', 'slip-ref', '0.2'], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True)
    for _ in range(400):
        wire.message(b'ABS_COMMAND_STATE', state.encode())
        try:
            heard = any(b'ABS_COMMAND\0' in ears.recv(65536) for _ in range(20))
        except TimeoutError:
            heard = False
        if heard:
            break
    check(heard, 'the command is sent')
    end = abs_hil.event_t()
    end.kind, end.phase, end.message = 'phase', abs_hil.telemetry_t.PHASE_STOPPED, 'brake -> stopped: all done'
    wire.message(b'ABS_EVENT', end.encode())
    started = time.monotonic()
    said = ''.join(sender.communicate(timeout=30))
    check(sender.returncode == 3 and 'the run ended: brake -> stopped: all done' in said, 'send says that the run ended',
          sender.returncode, said)
    check(time.monotonic() - started < 15, 'send does not wait after the end of the run')


def stop_latency(folder, tries, flood, judge=statistics.median_low):
    late = []
    for _ in range(tries):
        run, wire = Run(folder), Wire()
        run.wait_for_cycles()
        stop = abs_hil.command_t()
        stop.command = 'stop'
        data = stop.encode()
        if flood:
            for _ in range(2000):
                wire.message(b'ABS_COMMAND', os.urandom(60))
            time.sleep(0.05)
        sent_ns = time.monotonic_ns()
        wire.message(b'ABS_COMMAND', data)
        run.end()
        stamps = [m.stamp_ns for c, m in run.messages if c == 'ABS_TELEMETRY']
        ended = next(m for c, m in run.messages if c == 'ABS_TELEMETRY' and m.reason == 34)
        late.append(sum(sent_ns < stamp <= ended.stamp_ns for stamp in stamps))
    print(f'stop{" after a flood" if flood else ""}: cycles from sending to the safe command: {sorted(late)}')
    check(judge(late) <= 2, f'stop works within 2 cycles ({judge.__name__})', late)


def garbage(folder):
    run, wire, generator = Run(folder), Wire(), random.Random(5)
    before = abs_hil.command_t()
    before.command = 'stop'
    whole = before.encode()
    for _ in range(200):
        wire.raw(generator.randbytes(generator.randrange(0, 300)))                                   # no LCM at all
        wire.message(b'ABS_COMMAND', generator.randbytes(generator.randrange(0, 200)))               # garbage
        wire.message(b'ABS_COMMAND', whole[:generator.randrange(len(whole))])                        # truncated
        wire.message(b'ABS_COMMAND', abs_hil.event_t().encode())                                     # another type
        wire.message(b'ABS_COMMAND', bytes(3000))                                                    # too long
        wire.message(b'ABS_TELEMETRY', generator.randbytes(100))                                     # on another channel
        wire.raw(struct.pack('>II', SHORT, 1) + b'C' * 200)                                          # name without end
        wire.fragment(generator.randrange(1, 1 << 20), generator.randrange(1 << 20), generator.randrange(9),
                      generator.randrange(9), b'ABS_COMMAND\0' + generator.randbytes(100))
        wire.fragment(20_000, 0, 0, 3, b'ABS_COMMAND\0' + bytes(1000))                               # never completed
        time.sleep(0.002)
    for _ in range(20_000):
        wire.message(b'ABS_COMMAND', whole[:-2] + b'xx')                                             # at the highest speed
    check(run.end() == 0, 'garbage, fragments and a flood end no run', run.output)
    counts = [m for c, m in run.messages if c == 'ABS_COMMAND_STATE'][-1]
    check(counts.malformed > 500 and counts.stops == 0, 'they are counted and ignored',
          counts.malformed, counts.dropped, counts.stops)
    cycles = [m.cycle for c, m in run.messages if c == 'ABS_TELEMETRY']
    check(cycles == list(range(len(cycles))), 'no record was lost', len(cycles))
    check(len(run.answers) <= 12 * 12, 'a flood gets few answers', len(run.answers))
    print(f'malformed {counts.malformed}, dropped {counts.dropped}')


def series(folder, key):
    """A stop during a run or between two runs ends the whole series; the same command continues with the next run."""
    script, out = pathlib.Path(folder, 'series.toml'), pathlib.Path(folder, 'series')
    script.write_text('[settings]\nexperiment.start_speed_rad_s = 60\n[[phase]]\nname = "brake"\nbrake = "controller"\n'
                      'until = { car_speed_below_m_s = 1 }\nat_most_s = 20\n'
                      '[[phase]]\nname = "stopped"\nuntil = { lasts_s = 2 }\n[series]\nrepeat = 3\npause_s = 60\n')

    def statuses():
        return [run['status'] for run in json.loads((out / 'series.json').read_text())['runs']]

    def begin():
        return subprocess.Popen([PROGRAM, *PATIENT, '--rt', 'off', '--experiment', script, '--out', out, '--set',
                                 'commands.enabled=true', *KEY], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def wait_for(holds, what):
        deadline = time.monotonic() + 30
        while not holds():
            if time.monotonic() > deadline:
                sys.exit(f'FAILED: {what} within 30 s')
            time.sleep(0.02)

    program = begin()
    wait_for(lambda: (out / 'series.json').exists() and statuses()[0] == 'completed', 'the first run ends')
    ear, wire, answers = Ear(), Wire(), []

    def refused():
        wire.message(b'ABS_COMMAND', signed(key, '0' * 32, 1, 'slip-ref', value=0.3))
        answers.extend(ear.heard('ABS_EVENT', 0.2))
        return any('wire' in answer.message for answer in answers)

    wait_for(refused, 'an answer comes')
    answer = answers[-1]
    check(answer.reason == 46 and 'wire' in answer.message and answer.stamp_ns > 0, 'a change between two runs is refused',
          answer.reason, answer.message)
    found, said = send('stop')
    check(found == 0 and 'stop accepted' in said, 'a stop between two runs is accepted', found, said)
    words, errors = program.communicate(timeout=20)
    check(program.returncode == 1 and 'ended by a stop command with 1 of 3 runs done, 0 ended early' in words,
          'and ends the series', program.returncode, words, errors)
    program = begin()
    log = out / 'run-0002.part' / 'run.lcmlog'  # the folder is renamed when the run is over
    wait_for(lambda: log.exists() and b'ABS_TELEMETRY' in log.read_bytes(), 'the second run is under way')
    found, said = send('stop')
    check(found == 0, 'a stop in the second run', found, said)
    words, errors = program.communicate(timeout=20)
    check(program.returncode == 1 and 'ended by a stop command with 2 of 3 runs done, 1 ended early' in words,
          'ends the run and the series', program.returncode, words, errors)
    check(statuses() == ['completed', 'fault', 'planned'], 'the index records the states', statuses())


def question(folder):
    """A phase asks a person. A sender with the key may answer over the network."""
    script = pathlib.Path(folder, 'question.toml')
    script.write_text('[[phase]]\nname = "lift"\nask = "Lift the upper wheel"\nat_most_s = 30\n'
                      '[[phase]]\nname = "rest"\nuntil = { lasts_s = 0.5 }\n')
    run = Run(folder, '--rt', 'off', '--experiment', script, '--set', 'experiment.answers=person', '--set',
              'commands.enabled=true', *KEY)
    run.wait_for_cycles()
    found, said = send('continue')
    check(found == 0 and 'accepted: continue' in said, 'send continue answers the question', found, said)
    found, said = send('continue')
    check(found == 1 and 'the present phase asks nothing' in said, 'a second answer is refused', found, said)
    check(run.end() == 0, 'the run goes on to its end', run.output)


def main():
    global abs_hil, PROGRAM, KEY
    PROGRAM, private_network, module = map(os.path.abspath, sys.argv[1:4])
    if 'inside' not in sys.argv:
        os.execv(private_network, [private_network, sys.executable, __file__, *sys.argv[1:], 'inside'])
    sys.path.insert(0, module)
    import abs_hil
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        key = 'a secret of the lab, 32 characters'
        path = pathlib.Path(folder, 'commands.key')
        path.write_text(key + '\n')
        path.chmod(0o600)
        KEY = ['--set', f'commands.key_file={path}']
        os.environ['ABS_HIL_RUNS_DIR'] = folder
        if 'stop' in sys.argv:
            stop_latency(folder, 10, False, max)
            stop_latency(folder, 5, True, max)
            return
        live_changes(folder, key)
        not_enabled(folder)
        forged()
        run_ends_meanwhile()
        question(folder)
        stop_latency(folder, 5, False)
        stop_latency(folder, 3, True)
        series(folder, key)
        garbage(folder)


if __name__ == '__main__':
    main()
