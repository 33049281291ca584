"""The guardian: the controller is killed, stopped or crashes in each phase, and the card's PWMs read 0. The times are
printed, never asserted: this computer's own pauses reach tens of ms."""
import csv
import ctypes
import os
import pathlib
import shutil
import signal
import subprocess
import time
import unittest

from program import PROGRAM
from rig_emulator import RigTest, skip_unless_possible

SAFE = (0.0, 0.0)
PHASES = ('idle', 'accelerate', 'coast', 'brake', 'hold')
SIGNALS = (signal.SIGKILL, signal.SIGSTOP, signal.SIGSEGV)
# Every phase lasts long enough to be hit, and the wheel turns slowly, so that the last phase is not over soon.
EXPERIMENT = ('experiment.idle_s=0.4', 'experiment.cut_speed_rad_s=25', 'experiment.coast_s=0.3',
              'experiment.end_speed_m_s=1.5', 'experiment.hold_torque_Nm=0.3')
PR_SET_CHILD_SUBREAPER = 36
# Longer than this computer's pauses, so that a guardian acts for the test's reasons only.
PATIENT_MS = 500


def settings(*assignments):
    return [word for assignment in assignments for word in ('--set', assignment)]


def guardian_of(controller):
    """The process id of a controller's guardian."""
    for process in pathlib.Path('/proc').glob('[0-9]*'):
        try:
            fields = (process / 'stat').read_text()
            name = fields[fields.index('(') + 1:fields.rindex(')')]
            if name == 'abs_guardian' and int(fields[fields.rindex(')') + 2:].split()[1]) == controller:
                return int(process.name)
        except (OSError, ValueError):
            continue
    return None


def wait_until(condition, what, seconds=20):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what


class Guardian(RigTest):
    def setUp(self):
        super().setUp()
        # Orphaned guardians become children of this process, which waits for them.
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        self.record = self.folder / 'record'

    def start(self, emulator, timeout_ms, *args):
        # Late cycles depend on this computer: they must not end a run here.
        return self.real_time(emulator, '--recorder', self.record, '--set', 'realtime.max_consecutive_overruns=0',
                              '--set', 'realtime.late_max_s=1000', *args,
                              guardian_timeout_ms=timeout_ms)

    def wait_for_phase(self, emulator, program, phase):
        """Detects phases from the outputs on the wire."""
        try:
            self.see_phase(emulator, program, phase)
        except AssertionError as error:
            program.kill()
            raise AssertionError(f'{error}; it said: {program.communicate()[1][-1500:]}') from None

    def see_phase(self, emulator, program, phase):
        def status():
            drive, brake = emulator.wire()
            return drive > 0.9, brake > 0.3, emulator.lower_speed()
        if phase == 'idle':
            wait_until(lambda: guardian_of(program.pid), 'no guardian')
            time.sleep(0.15)  # before its first cycle a controller drives nothing and has no guardian
            return
        wait_until(lambda: status()[0] and status()[2] > 1, 'never accelerated')
        if phase == 'accelerate':
            return
        wait_until(lambda: not status()[0], 'never coasted')
        if phase == 'coast':
            return
        wait_until(lambda: status()[1], 'never braked')
        if phase == 'hold':
            wait_until(lambda: status()[2] < 14, 'never held')

    def wait_until_guardian_ended(self, pid):
        wait_until(lambda: not pathlib.Path(f'/proc/{pid}').exists() or os.waitpid(pid, os.WNOHANG)[0] == pid,
                   'the guardian outlives the run')

    def record_text(self):
        files = sorted(self.record.glob('*.txt'))
        self.assertEqual(len(files), 1)
        return files[0].read_text()

    def test_controller_ends_in_each_phase(self):
        took_ms = {number: [] for number in SIGNALS}
        for number in SIGNALS:
            for phase in PHASES:
                with self.subTest(signal=number.name, phase=phase):
                    emulator = self.emulator()
                    self.record = self.folder / f'record-{number.name}-{phase}'
                    program = self.start(emulator, PATIENT_MS, *settings(*EXPERIMENT))
                    self.wait_for_phase(emulator, program, phase)
                    guardian = guardian_of(program.pid)
                    before_ns = time.monotonic_ns()
                    program.send_signal(number)
                    program.wait(timeout=20)  # also a stopped one: its guardian ends it
                    self.wait_until_guardian_ended(guardian)
                    self.assertEqual(emulator.wire(), SAFE)
                    took_ms[number].append(self.ms_until_zero(emulator, before_ns))
                    _, words = program.communicate(timeout=20)
                    self.assertIn('drive 0 and brake 0 written and read back', words)
                    self.assertIn('gave no sign of life' if number == signal.SIGSTOP else 'process died', words)
                    self.assertEqual(program.returncode, -9 if number == signal.SIGSTOP else -number)
                    self.check_record()
                    emulator.end()
        for number, times in took_ms.items():
            print(f'{number.name}: both PWMs 0 after (ms)', *(f'{t:.1f}' for t in sorted(times)))

    def ms_until_zero(self, emulator, since_ns):
        """Time by the card's clock; 0 if nothing was driven."""
        widths = emulator.widths()
        self.assertEqual((widths.drive, widths.brake), (0, 0))
        self.assertGreater(widths.last_written_ns, since_ns)
        return max(0, widths.zero_since_ns - since_ns) * 1e-6

    def check_record(self):
        """Complete rows at full rate up to the end; another test reads the log with LCM's own reader."""
        text = self.record_text()
        self.assertIn('the controller', text)
        csv_file = next(self.record.glob('*.csv'))
        with open(csv_file, newline='') as file:
            rows = list(csv.DictReader(file))
        self.assertIn(f'{len(rows)} cycles recorded', text)
        cycles = [int(row['cycle']) for row in rows]
        self.assertEqual(cycles, list(range(cycles[0], cycles[-1] + 1)) if cycles else [])
        self.assertLessEqual(len(rows), 2000)
        self.assertGreater(next(self.record.glob('*.lcmlog')).stat().st_size, 300 * len(rows))

    def test_pause_of_the_whole_computer_is_a_fault(self):
        emulator = self.emulator()
        program = self.start(emulator, 200, *settings(*EXPERIMENT))
        self.wait_for_phase(emulator, program, 'brake')
        both = guardian_of(program.pid), program.pid
        for pid in both:
            os.kill(pid, signal.SIGSTOP)
        time.sleep(0.5)
        self.assertNotEqual(emulator.wire(), SAFE)  # the card's outputs hold
        for pid in both:
            os.kill(pid, signal.SIGCONT)
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 1, words)
        self.assertIn('no cycle ran for longer than realtime.cycle_gap_max_s', words)
        self.assertEqual(emulator.wire(), SAFE)
        with open(next(self.record.glob('*.csv')), newline='') as file:
            rows = list(csv.DictReader(file))
        after = [n for n in range(1, len(rows)) if float(rows[n]['time_s']) - float(rows[n - 1]['time_s']) > 0.4]
        self.assertEqual(len(after), 1)
        # At most one command that was computed before the pause, then zero.
        self.assertLessEqual(len(rows) - after[0], 2)
        self.assertEqual([float(rows[-1][name]) for name in ('motor_pwm', 'brake_pwm')], [0.0, 0.0])
        emulator.end()

    def test_guardian_ends_first(self):
        died, silent = 'the guardian process died', 'the guardian process gave no sign of life'
        took_ms = []
        for number, phase, words in (*((signal.SIGKILL, phase, died) for phase in PHASES),
                                     (signal.SIGSEGV, 'accelerate', died), (signal.SIGSTOP, 'accelerate', silent),
                                     (signal.SIGSTOP, 'brake', silent)):
            with self.subTest(signal=number.name, phase=phase):
                emulator = self.emulator()
                summary, csv_file = self.folder / f'{number}{phase}.json', self.folder / f'{number}{phase}.csv'
                program = self.start(emulator, PATIENT_MS, *settings(*EXPERIMENT), '--summary', summary, '--csv',
                                     csv_file)
                self.wait_for_phase(emulator, program, phase)
                guardian = guardian_of(program.pid)
                before_ns = time.monotonic_ns()
                os.kill(guardian, number)
                _, errors = program.communicate(timeout=20)
                self.assertEqual(program.returncode, 1, errors)
                self.assertIn(words, errors)
                self.assertEqual(emulator.wire(), SAFE)
                self.assertEqual(self.summary(summary)['result'], 'fault')
                self.assertEqual(self.rows(csv_file)[-1]['phase'], 'fault')
                self.assertIsNone(guardian_of(program.pid))
                took_ms.append(f'{number.name} {phase} {self.ms_until_zero(emulator, before_ns):.1f}')
                emulator.end()
        print('guardian first, both PWMs 0 after (ms):', ', '.join(took_ms))

    def test_terminal_signals_do_not_reach_the_guardian(self):
        emulator = self.emulator()
        program = self.start(emulator, PATIENT_MS)
        self.wait_for_phase(emulator, program, 'accelerate')
        guardian = guardian_of(program.pid)
        self.assertNotEqual(os.getsid(guardian), os.getsid(program.pid))
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGPIPE):
            os.kill(guardian, number)
        time.sleep(0.3)
        self.assertIsNone(program.poll())
        self.assertGreater(emulator.wire()[0], 0.9)
        program.kill()
        program.communicate(timeout=20)
        wait_until(lambda: emulator.wire() == SAFE, 'the outputs hold')

    def test_run_in_order_leaves_no_guardian_and_no_record(self):
        emulator = self.emulator()
        program = self.start(emulator, 1000, *settings('experiment.cut_speed_rad_s=10'))
        wait_until(lambda: guardian_of(program.pid), 'no guardian')
        guardian = guardian_of(program.pid)
        _, errors = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, errors)
        self.assertFalse(pathlib.Path(f'/proc/{guardian}').exists())
        self.assertEqual(list(self.record.iterdir()), [])
        self.assertNotIn('abs_guardian:', errors)

    def test_without_guardian_nothing_moves(self):
        emulator = self.emulator()
        alone = self.folder / 'alone'
        alone.mkdir()
        os.link(PROGRAM, alone / 'abs_hil') if os.stat(PROGRAM).st_dev == os.stat(alone).st_dev else \
            subprocess.run(['cp', PROGRAM, alone / 'abs_hil'], check=True)
        for name, content in (('missing', None), ('none', '#!/bin/sh\nexit 0\n'), ('not a program', 'x')):
            with self.subTest(name):
                if not content and shutil.which('abs_guardian'):
                    continue  # an installed guardian replaces it
                if content:
                    (alone / 'abs_guardian').write_text(content)
                    (alone / 'abs_guardian').chmod(0o755)
                result = subprocess.run([alone / 'abs_hil', '--backend', 'rig', '--no-lcm', '--set',
                                         f'driver.pci.root={emulator.root}'], capture_output=True, text=True,
                                        timeout=20, cwd=self.folder)
                self.assertEqual(result.returncode, 3, result.stderr)
                self.assertIn('guardian: ', result.stderr)
                self.assertEqual(emulator.wire(), SAFE)
        result = self.run_program('--backend', 'rig', '--no-lcm', '--set', f'driver.pci.root={emulator.root}', '--set',
                                  'guardian.enabled=false')
        self.assertEqual(result.returncode, 2)
        self.assertIn('guardian.enabled', result.stderr)

    @unittest.skipUnless(os.getuid() == 0 and shutil.which('setpriv'), 'needs root and setpriv')
    def test_guardian_weaker_than_the_controller_is_refused(self):
        """As after a setcap of abs_hil alone: the controller has SCHED_FIFO, its guardian has not."""
        emulator = self.emulator()
        alone = self.folder / 'weak'
        alone.mkdir()
        subprocess.run(['cp', PROGRAM, alone / 'abs_hil'], check=True)
        real = pathlib.Path(PROGRAM).resolve().parent / 'abs_guardian'
        for rights, weak in (('-sys_nice,-ipc_lock', 'no SCHED_FIFO'), ('+all', None)):
            guardian = alone / 'abs_guardian'
            guardian.write_text(f'#!/bin/sh\nexec prlimit --rtprio=0 --memlock=0 setpriv --bounding-set={rights} {real}\n')
            guardian.chmod(0o755)
            result = subprocess.run([alone / 'abs_hil', '--backend', 'rig', '--no-lcm', '--rt', 'prefer', *settings(
                f'driver.pci.root={emulator.root}', f'guardian.timeout_ms={PATIENT_MS}',
                'realtime.max_consecutive_overruns=0', 'realtime.late_max_s=1000', 'experiment.cut_speed_rad_s=10')],
                capture_output=True, text=True, timeout=60, cwd=self.folder)
            if 'NOT IN REAL TIME' in result.stderr:
                self.skipTest('this computer gives no real time')
            self.assertEqual(result.returncode, 3 if weak else 0, result.stderr)
            if weak:
                self.assertIn(weak, result.stderr)
                self.assertIn('setcap', result.stderr)
                self.assertEqual(emulator.wire(), SAFE)

    def test_card_being_made_safe_has_no_other_owner(self):
        emulator = self.emulator()
        program = self.start(emulator, PATIENT_MS, *settings('guardian.insist_s=3'))
        self.wait_for_phase(emulator, program, 'accelerate')
        guardian = guardian_of(program.pid)
        emulator.command('fault 6c:wrong=1')
        program.kill()
        program.wait(timeout=20)
        self.assertEqual(program.stdout.read(), '')
        result = self.run_program('--backend', 'rig', '--no-lcm', '--set', f'driver.pci.root={emulator.root}')
        self.assertEqual(result.returncode, 3)
        self.assertIn(f'process {guardian} (abs_guardian) still brings the card into the safe state', result.stderr)
        emulator.command('fault 6c:ok')
        self.wait_until_guardian_ended(guardian)
        self.assertEqual(emulator.wire(), SAFE)
        self.assertIn('written and read back', self.record_text())

    def test_outputs_that_the_controller_cannot_verify_are_handed_over(self):
        emulator = self.emulator()
        program = self.start(emulator, 1000, *settings('guardian.insist_s=20'))
        self.wait_for_phase(emulator, program, 'accelerate')
        guardian = guardian_of(program.pid)
        emulator.command('fault 6c:wrong=1')
        # The error stays until the controller has given up; then the guardian continues.
        program.wait(timeout=20)
        self.assertEqual(program.returncode, 1)
        self.assertTrue(pathlib.Path(f'/proc/{guardian}').exists())
        emulator.command('fault 6c:ok')
        self.wait_until_guardian_ended(guardian)
        _, errors = program.communicate(timeout=20)
        self.assertIn('still tries to make the outputs safe', errors)
        self.assertIn('the controller could not verify the safe state', errors)
        self.assertIn('written and read back', errors)
        self.assertEqual(emulator.wire(), SAFE)


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main(verbosity=2)
