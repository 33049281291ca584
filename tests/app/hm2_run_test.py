"""The paper's experiment through driver.kind=hm2, against the emulated 7I92T in another process: in lock-step it agrees with
the simulator; in real time the board's watchdog ends what nobody else can. Outcomes and the board's own clock are asserted,
never this computer's timing."""
import contextlib
import json
import os
import pathlib
import re
import signal
import socket
import subprocess
import threading
import time
import unittest

from can_emulator import skip_unless_possible
from emulator_process import REAL_TIME, EmulatorProcess, EmulatorTest
from program import PROGRAM
from resident_guardian import Group, Service, wait_until

SAFE = (0.0, 0.0)
WATCHDOG_MS = 20


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return probe.getsockname()[1]


class Board(EmulatorProcess):
    """A running abs_rig_emulator --hm2."""

    def __init__(self, folder, *args):
        self.address = f'127.0.0.1:{free_port()}'
        super().__init__(folder, '--hm2', self.address, *args)


class WithoutMark(threading.Thread):
    """A board without an emulator's mark: passes datagrams on to an emulator, and takes the mark out of its answers."""

    def __init__(self, board, host):
        super().__init__(daemon=True)
        self.here, self.there = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.here.bind((host, 0))
        self.there.connect(('127.0.0.1', int(board.address.split(':')[1])))
        for one in (self.here, self.there):
            one.settimeout(0.02)
        self.over = False
        self.address = f'{host}:{self.here.getsockname()[1]}'
        self.start()

    def end(self):
        self.over = True
        self.join()
        self.here.close()
        self.there.close()

    def run(self):
        while not self.over:
            with contextlib.suppress(TimeoutError):
                asked, client = self.here.recvfrom(2000)
                self.there.send(asked)
                answer = self.there.recv(2000)
                self.here.sendto(answer.replace(b'\x05\x5a', b'\0\0') if b'\x82\x75' in asked else answer, client)


class Hm2Run(EmulatorTest):
    BOARD = Board
    #: Commands of the emulator, and words of the error that they must give.
    FAULTS = [('fault lose-answers=10', 'lost ten datagrams in a row'),
              ('bite', 'watchdog dropped all outputs'),
              ('power-cycle', 'was restarted'),
              ('quadrature-error upper', 'both signals of an encoder'),
              ('talker read', 'something else writes')]

    def board(self, *args):
        return self.start_emulator(self.BOARD, *args)

    def arguments(self, board, *args):
        return ['--backend', 'rig', '--no-lcm', '--no-out', '--set', 'driver.kind=hm2', '--set',
                f'driver.hm2.address={board.address}', *map(str, args)]

    def lock_step(self, board, *args):
        return self.run_program(*self.arguments(board, '--fast', '--set', 'driver.emulated=true', *args))

    def start_real_time(self, board, *args, enter=None):
        # A computer under load wakes its programs late.
        words = self.arguments(board, *REAL_TIME, '--set', 'guardian.timeout_ms=1000', '--set', 'realtime.cycle_gap_max_s=1', *args)
        self._programs.append(subprocess.Popen([pathlib.Path(PROGRAM).resolve(), *words], cwd=self.folder,
                                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                               preexec_fn=enter))
        return self._programs[-1]

    def wait_for_drive(self, board, program):
        for _ in range(400):
            if board.wire()[0] > 0.0:
                return
            if program.poll() is not None:
                raise AssertionError(f'the run ended: {program.communicate()[1]}')
            time.sleep(0.05)
        raise AssertionError('the drive did not come on')

    def zeros(self, board):
        """ms since the last reload of the watchdog, of each event in which it zeroed the outputs."""
        board.command('status')  # reads what it has printed so far
        return [float(found[1]) for line in board.lines
                if (found := re.search(r'outputs zero: watchdog; watchdog last reloaded ([\d.]+) ms ago', line))]

    def ms_until_zero(self, board):
        """The same for any last writer of the zeros."""
        self.assertEqual(board.wire(), SAFE)
        return float([found[1] for line in board.lines
                      if (found := re.search(r'outputs zero: .*last reloaded ([\d.]+) ms ago', line))][-1])

    def stays_off(self, board):
        for _ in range(20):
            self.assertEqual(board.wire(), SAFE)
            time.sleep(0.02)

    def test_lock_step_agrees_with_the_simulator(self):
        rig, sim = self.folder / 'rig.json', self.folder / 'sim.json'
        self.fast('--summary', sim, '--set', 'gate.brake_duty_max=0.7')
        board = self.board('--lock-step')
        result = self.lock_step(board, '--summary', rig)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('not verified on hardware', result.stderr)
        self.assertIn('an emulator: no commissioning record is asked for', result.stderr)
        self.assertIn('0 without an answer in time; 0 writes lost', result.stderr)
        r, s = self.summary(rig), self.summary(sim)
        self.assertEqual(r['telemetry_drops'], 0)
        for key in ('stop_time_s', 'stop_distance_m', 'theta_final_N', 'brake_start_s'):
            self.assertAlmostEqual(r[key] / s[key], 1.0, delta=0.01, msg=key)
        self.assertEqual(board.wire(), SAFE)

    def test_a_board_without_the_mark_is_no_emulator(self):
        """Neither at this computer's own address nor where driver.emulated says so."""
        other = '10.77.64.1'
        subprocess.run(['ip', 'address', 'add', f'{other}/32', 'dev', 'lo'], check=False)
        board = self.board()
        claimed = ('--set', 'driver.emulated=true')
        for host, keys in (('127.0.0.1', ()), ('127.0.0.1', claimed), (other, claimed), ('127.0.0.1', (*claimed, '--fast'))):
            with self.subTest(host=host, keys=keys):
                real = WithoutMark(board, host)
                self.addCleanup(real.end)
                result = self.run_program(*self.arguments(real, *keys))
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn("carries no emulator's mark", result.stderr)
        real = WithoutMark(board, other)
        self.addCleanup(real.end)
        result = self.run_program(*self.arguments(real))
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn('commission', result.stderr)
        self.assertIn('writes 0', board.command('status'))

    def test_latency_measures_the_wire_of_a_board_that_gets_only_zeros(self):
        board = self.board()
        result = self.run_program('latency', '--backend', 'rig', '--rt', 'off', '--duration', '1', '--json', '--set',
                                  'driver.kind=hm2', '--set', f'driver.hm2.address={board.address}', '--set',
                                  'guardian.timeout_ms=1000', '--set', 'realtime.cycle_gap_max_s=1')
        self.assertEqual(result.returncode, 0, result.stderr)
        found = json.loads(result.stdout)
        wire = found['wire_us']
        self.assertGreater(wire['answers'], 0.5 * found['cycles'])  # not in real time, an answer may come too late
        self.assertGreater(wire['mean'], 0.0)
        self.assertEqual(board.wire(), SAFE)
        self.assertFalse([line for line in board.lines if 'outputs on' in line])

    def test_faults_of_the_board_end_a_run_with_their_reasons(self):
        for command, words in self.FAULTS:
            with self.subTest(command):
                board = self.board()
                program = self.start_real_time(board)
                self.wait_for_drive(board, program)
                board.command(command)
                error = program.communicate(timeout=120)[1]
                self.assertEqual(program.returncode, 1, error)
                self.assertIn(words, error)
                board.command('talker off')
                self.assertEqual(board.wire(), SAFE)
                board.end()

    def test_program_and_guardian_dead_or_stopped_the_watchdog_acts_in_its_time(self):
        for stop in (signal.SIGKILL, signal.SIGSTOP):
            with self.subTest(stop):
                board = self.board()
                program = self.start_real_time(board)
                self.wait_for_drive(board, program)
                guardians = self.guardians_of(program.pid)
                self.assertEqual(len(guardians), 1)
                try:
                    for pid in (*guardians, program.pid):  # the guardian first, or it would act
                        self.send(pid, stop)
                    time.sleep(0.5)
                    self.assertEqual(board.wire(), SAFE)
                    self.assertLessEqual(self.zeros(board)[-1], WATCHDOG_MS + 2)
                finally:
                    for pid in (*guardians, program.pid):
                        self.send(pid, signal.SIGKILL)
                    program.communicate(timeout=20)
                board.end()

    def test_cable_out_and_in_again_the_outputs_stay_off(self):
        board = self.board()
        program = self.start_real_time(board, '--set', 'guardian.insist_s=30')
        self.wait_for_drive(board, program)
        board.command('link down')
        time.sleep(0.5)
        self.assertEqual(board.wire(), SAFE)
        self.assertLessEqual(self.zeros(board)[-1], WATCHDOG_MS + 2)
        board.command('link up')
        error = program.communicate(timeout=60)[1]
        self.assertEqual(program.returncode, 1, error)
        self.assertIn('lost ten datagrams in a row', error)
        self.stays_off(board)

    def test_cable_in_again_while_nobody_lives_the_outputs_stay_off(self):
        board = self.board()
        program = self.start_real_time(board)
        self.wait_for_drive(board, program)
        board.command('link down')
        for pid in (*self.guardians_of(program.pid), program.pid):
            self.send(pid, signal.SIGKILL)
        program.communicate(timeout=20)
        time.sleep(0.1)
        self.assertLessEqual(self.ms_until_zero(board), WATCHDOG_MS + 2)
        board.command('link up')
        self.stays_off(board)

    def test_stopped_program_that_goes_on_brings_no_output_back(self):
        board = self.board()
        program = self.start_real_time(board)
        self.wait_for_drive(board, program)
        guardians = self.guardians_of(program.pid)
        for pid in (*guardians, program.pid):
            self.send(pid, signal.SIGSTOP)
        time.sleep(0.3)
        self.assertLessEqual(self.ms_until_zero(board), WATCHDOG_MS + 2)
        for pid in (program.pid, *guardians):
            self.send(pid, signal.SIGCONT)
        self.stays_off(board)
        error = program.communicate(timeout=60)[1]
        self.assertEqual(program.returncode, 1, error)

    def test_end_of_the_whole_control_group(self):
        why_not = Group.why_not()
        if why_not:
            self.skipTest(why_not)
        board = self.board()
        group = Group('hm2')
        try:
            program = self.start_real_time(board, enter=group.enter)
            self.wait_for_drive(board, program)
            self.assertEqual(len(self.guardians_of(program.pid)), 1)
            group.write('cgroup.kill', '1')
            program.communicate(timeout=20)
            self.assertEqual(program.returncode, -signal.SIGKILL)
            time.sleep(0.1)
            self.assertLessEqual(self.ms_until_zero(board), WATCHDOG_MS + 2)
            self.stays_off(board)
        finally:
            group.remove()

    def resident(self, board):
        service = Service(self.folder, 'driver.kind=hm2', f'driver.hm2.address={board.address}',
                          'guardian.timeout_ms=1000')
        self.addCleanup(self.end_service, service)
        return service

    def end_service(self, service):
        """Also what a service leaves whose guard was killed: its standby guards on."""
        service.end()
        for process in service.children_left():
            self.send(int(process.name), signal.SIGTERM)
        wait_until(lambda: not service.children_left(), 'the service lives on')

    def start_resident(self, board, service):
        program = self.start_real_time(board, '--set', 'guardian.resident=require', '--set',
                                       f'guardian.socket={service.socket}')
        self.wait_for_drive(board, program)
        self.assertEqual(self.guardians_of(program.pid), [])
        return program

    def test_run_under_the_resident_guardian(self):
        board = self.board()
        service = self.resident(board)
        summary = self.folder / 'resident.json'
        program = self.start_real_time(board, '--set', 'guardian.resident=require', '--set',
                                       f'guardian.socket={service.socket}', '--summary', summary, '--set',
                                       'gate.brake_duty_max=0.7')
        error = program.communicate(timeout=120)[1]
        self.assertEqual(program.returncode, 0, error)
        self.assertEqual(self.summary(summary)['result'], 'completed')
        self.assertEqual(board.wire(), SAFE)

    def test_program_killed_or_stopped_under_the_resident_guardian(self):
        for stop in (signal.SIGKILL, signal.SIGSTOP):
            with self.subTest(stop):
                board = self.board()
                service = self.resident(board)
                program = self.start_resident(board, service)
                self.send(program.pid, stop)
                time.sleep(0.3)
                self.assertLessEqual(self.ms_until_zero(board), WATCHDOG_MS + 2)
                self.stays_off(board)
                self.send(program.pid, signal.SIGKILL)
                program.communicate(timeout=20)
                service.end()
                board.end()

    def test_companions_of_the_resident_guardian_die(self):
        """Its standby, its talker: the run goes on, new ones start, and the guard still sleeps between its looks."""
        board = self.board()
        service = self.resident(board)
        program = self.start_resident(board, service)
        guard = service.process.pid
        for _ in ('standby', 'talker'):
            old = self.children_of(guard)
            os.kill(min(old), signal.SIGKILL)  # the oldest
            wait_until(lambda old=old: len(set(self.children_of(guard)) - set(old)) == 1, 'no new companion')
        error = program.communicate(timeout=120)[1]
        self.assertEqual(program.returncode, 0, error)
        wait_until(lambda: service.said().count('grants leases at') == 2, 'no new talker')
        used_s = self.processor_s(guard)
        time.sleep(1)
        self.assertLess(self.processor_s(guard) - used_s, 0.5)

    def test_program_and_resident_guardian_dead_and_the_cable_out_and_in(self):
        board = self.board()
        service = self.resident(board)
        program = self.start_resident(board, service)
        # All stand still before the first one dies: the others would act, or start another standby.
        self.send(program.pid, signal.SIGSTOP)
        service.stop()
        for process in service.children_left():
            self.send(int(process.name), signal.SIGKILL)
        program.kill()
        program.communicate(timeout=20)
        wait_until(lambda: not service.children_left(), 'a part of the service lives on')
        time.sleep(0.1)
        self.assertLessEqual(self.ms_until_zero(board), WATCHDOG_MS + 2)
        board.command('link down')
        time.sleep(0.1)
        board.command('link up')
        self.stays_off(board)

    def test_paper_in_real_time(self):
        summary = self.folder / 'real.json'
        board = self.board()
        program = self.start_real_time(board, '--summary', summary, '--set', 'gate.brake_duty_max=0.7')
        error = program.communicate(timeout=180)[1]
        self.assertEqual(program.returncode, 0, error)
        self.assertEqual(self.summary(summary)['telemetry_drops'], 0)
        self.assertEqual(board.wire(), SAFE)

    def test_safe_and_doctor_reach_a_board_that_is_named(self):
        board = self.board()
        named = ('--set', 'driver.kind=hm2', '--set', f'driver.hm2.address={board.address}')
        result = self.run_program('safe', *named)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('board of driver.kind=hm2: drive 0 and brake 0, verified', result.stdout)
        doctor = self.run_program('doctor', '--only', 'hm2', *named)
        self.assertIn('round trips to the board', doctor.stdout)
        self.assertRegex(doctor.stdout, r'\d+ of 500 answered')

    @staticmethod
    def send(pid, number):
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            pass

    @staticmethod
    def children_of(pid):
        return [int(child) for children in pathlib.Path(f'/proc/{pid}/task').glob('*/children')
                for child in children.read_text().split()]

    @staticmethod
    def processor_s(pid):
        times = pathlib.Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
        return (int(times[11]) + int(times[12])) / os.sysconf('SC_CLK_TCK')

    def guardians_of(self, pid):
        return [child for child in self.children_of(pid)
                if pathlib.Path(f'/proc/{child}/comm').read_text().startswith('abs_guardian')]


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main(verbosity=2)
