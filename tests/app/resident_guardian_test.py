"""The resident guardian, in a process of its own: what ends or stops a run and everything it started leaves the card's
PWMs at 0. Times are printed, never asserted: this computer's own pauses reach tens of ms (tests/vm asserts them).

usage: resident_guardian_test.py ABS_HIL [TRIES [PAIRS]]
"""
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

TRIES = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 4
PAIRS = int(sys.argv.pop(2)) if len(sys.argv) > 2 and sys.argv[2].isdigit() else 8

from program import PROGRAM  # noqa: E402
from resident_guardian import (GUARDIAN, Group, ResidentTest, SAFE, connect, granted_and_ended, say_times,  # noqa: E402
                               settings, wait_until)
from rig_emulator import skip_unless_possible  # noqa: E402

SECOND_S = 1.0
#: a PID namespace with a /proc of its own. In a chroot / is no mount, whose propagation could be changed.
CONTAINER = ('unshare', '--pid', '--fork', '--mount-proc', '--propagation', 'unchanged', '--kill-child')
UNSHARE_OF_KILLED = (1, 128 + signal.SIGKILL, -signal.SIGKILL)  # its versions differ


def need_container(test):
    probe = subprocess.run([*CONTAINER, 'true'], capture_output=True, text=True)
    if probe.returncode != 0:
        test.skipTest(f'no namespace of our own here: {probe.stderr.strip()}')


class Leases(ResidentTest):
    def test_run_in_order(self):
        emulator = self.emulator()
        service = self.service(emulator)
        program = self.start(emulator)
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, words)
        self.assertIn(f'the resident service guards this run (process {service.process.pid}', words)
        wait_until(lambda: 'lease ended' in service.said(), 'the lease did not end')
        self.assertEqual([word for word, _ in granted_and_ended(service.said())], ['granted to', 'ended:'])
        self.assertEqual(service.end(), 0)
        self.assertFalse(service.socket.exists())

    def test_outputs_are_zeroed_at_the_start(self):
        emulator = self.emulator()
        program = self.start(emulator, '--set', 'driver.emulated=true', resident='off',
                             experiment=('guardian.enabled=false',))
        self.wait_until_driven(emulator, program)
        program.kill()
        program.wait()
        self.assertNotEqual(emulator.wire(), SAFE)  # nobody guards an emulator
        self.service(emulator)
        self.assertEqual(emulator.wire(), SAFE)

    def test_lease_is_never_granted_twice(self):
        emulator = self.emulator()
        service = self.service(emulator)
        refused = 0
        for _ in range(PAIRS):
            pair = [self.start(emulator) for _ in range(2)]
            for program in pair:
                _, words = program.communicate(timeout=30)
                self.assertIn(program.returncode, (0, 3), words)
                if program.returncode == 3:
                    refused += 1
                    self.assertIn('there is only one at a time', words)
        told = granted_and_ended(service.said())
        wait_until(lambda: len(granted_and_ended(service.said())) % 2 == 0, 'a lease did not end')
        told = granted_and_ended(service.said())
        self.assertEqual([word for word, _ in told], ['granted to', 'ended:'] * (len(told) // 2))
        for granted, ended in zip(told[::2], told[1::2]):
            self.assertEqual(granted[1], ended[1])
        self.assertEqual(len(told) // 2 + refused, 2 * PAIRS)
        self.assertGreater(refused, 0)
        print(f'{PAIRS} pairs of runs: {len(told) // 2} leases, {refused} refused')

    def test_refusals(self):
        emulator, other = self.emulator(), self.emulator()
        service = self.service(emulator)
        result = subprocess.run(self.command(other), capture_output=True, text=True, timeout=20, cwd=self.folder)
        self.assertEqual(result.returncode, 3)
        self.assertIn(f'it keeps pci, root {emulator.root}, bdf the only one', result.stderr)
        self.assertIn('guardian.socket', result.stderr)
        second = subprocess.run([GUARDIAN, 'serve', '--socket', service.socket], capture_output=True, text=True)
        self.assertEqual(second.returncode, 3)
        self.assertIn(f'process {service.process.pid} listens there already', second.stderr)
        for args, words in ((['--set', 'guardian.keep_ms=0.1'], 'guardian.keep_ms'), (['--sockets', 'x'], '--sockets'),
                            (['--config', self.folder / 'none.toml'], 'none.toml')):
            wrong = subprocess.run([GUARDIAN, 'serve', *map(str, args)], capture_output=True, text=True)
            self.assertEqual(wrong.returncode, 2, wrong.stderr)
            self.assertIn(words, wrong.stderr)
        taken = self.folder / 'a file'
        taken.write_text('kept')
        wrong = subprocess.run([GUARDIAN, 'serve', '--socket', taken], capture_output=True, text=True)
        self.assertEqual(wrong.returncode, 3)
        self.assertEqual(taken.read_text(), 'kept')
        # A board that cannot be made safe is not granted.
        emulator.command('fault 6c:wrong=1')
        result = subprocess.run(self.command(emulator), capture_output=True, text=True, timeout=20, cwd=self.folder)
        self.assertEqual(result.returncode, 3)
        self.assertIn('cannot be made safe', result.stderr)
        emulator.command('fault 6c:ok')
        # What is no request of ours gets no lease and does no harm.
        for packet in (b'', b'x', b'a' * 40):
            with connect(service.socket) as client:
                client.send(packet)
                self.assertIn(client.recv(1000), (b'',))
        self.assertEqual(self.start(emulator).wait(timeout=30), 0)

    def test_without_a_service(self):
        emulator = self.emulator()
        result = subprocess.run(self.command(emulator), capture_output=True, text=True, timeout=20, cwd=self.folder)
        self.assertEqual(result.returncode, 3)
        self.assertIn('no resident service listens at', result.stderr)
        self.assertIn('guardian.resident', result.stderr)
        program = self.start(emulator, resident='auto')
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, words)
        self.assertRegex(words, r'guardian: process \d+, which this run started, stands by')

    def test_first_process_of_a_namespace_needs_the_service(self):
        need_container(self)
        emulator = self.emulator()
        for resident in ('off', 'auto'):
            program = self.start(emulator, before=CONTAINER, resident=resident)
            _, words = program.communicate(timeout=30)
            self.assertEqual(program.returncode, 3, words)
            self.assertIn('process 1 of its namespace', words)
            self.assertEqual(emulator.wire(), SAFE)
        self.service(emulator)
        program = self.start(emulator, before=CONTAINER)
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, words)

    def test_board_that_comes_back_is_zeroed(self):
        emulator = self.emulator()
        service = self.service(emulator)
        program = self.start(emulator)
        self.wait_until_driven(emulator, program)
        emulator.command('fault 6c:wrong=1')
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 1, words)
        time.sleep(2 * SECOND_S)  # longer than the first tries
        self.assertIn('NOT SAFE', service.said())
        emulator.command('fault 6c:ok')
        wait_until(lambda: service.said().rstrip().endswith('written and read back'), 'not made safe')
        self.assertEqual(emulator.wire(), SAFE)

    def safe(self, emulator, service, *args):
        return self.run_program('safe', *settings(f'driver.pci.root={emulator.root}', f'guardian.socket={service.socket}'),
                                *args)

    def doctor(self, emulator, service, *args):
        result = self.run_program('doctor', *args, *settings(
            f'driver.pci.root={emulator.root}', f'guardian.socket={service.socket}', 'driver.emulated=true',
            'guardian.resident=require'))
        return result.stdout

    def test_safe_asks_the_service_too(self):
        emulator = self.emulator()
        service = self.service(emulator)
        for driven in (False, True):
            with self.subTest(driven=driven):
                if driven:
                    program = self.start(emulator)
                    self.wait_until_driven(emulator, program)
                result = self.safe(emulator, service)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual(emulator.wire(), SAFE)
                self.assertIn('RT-DAC4/PCI at 0000:03:00.0: drive 0 and brake 0, verified', result.stdout)
                self.assertIn(f'the resident service (process {service.process.pid}, {service.socket})', result.stdout)
                if driven:
                    self.assertIn(f'ended process {program.pid} (abs_hil)', result.stdout)
        program.communicate(timeout=30)
        wait_until(lambda: 'lease ended' in service.said(), 'the lease did not end')
        _, words = self.start(emulator).communicate(timeout=30)
        self.assertEqual(self._programs[-1].returncode, 0, 'the next run gets a lease: ' + words)

    def test_safe_with_a_service_ends_a_stopped_run(self):
        emulator = self.emulator()
        service = self.service(emulator)
        program = self.start(emulator)
        self.wait_until_driven(emulator, program)
        program.send_signal(signal.SIGSTOP)
        result = self.safe(emulator, service)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(emulator.wire(), SAFE)
        program.communicate(timeout=30)
        self.assertEqual(program.returncode, -signal.SIGKILL)

    def test_safe_does_not_believe_a_service_that_cannot_verify(self):
        emulator = self.emulator()
        service = self.service(emulator)
        emulator.command('fault 6c:wrong=1')
        result = self.safe(emulator, service, '--insist', '0.2')
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertIn('SAFE STATE NOT VERIFIED', result.stderr)
        self.assertIn('register does not read back', result.stderr)
        emulator.command('fault 6c:ok')

    def test_a_service_of_another_board_is_left_alone(self):
        """Its run goes on, and the board that was meant is made safe without it."""
        mine, others = self.emulator(), self.emulator()
        service = self.service(others)
        program = self.start(others)
        self.wait_until_driven(others, program)
        result = self.safe(mine, service)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn('resident', result.stdout)
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, words)

    def test_doctor_says_who_has_the_lease(self):
        emulator = self.emulator()
        service = self.service(emulator)
        keeps = f'process {service.process.pid} keeps pci, '
        for args in (('--only', 'boards'), ('--backend', 'rig', '--only', 'backend')):
            with self.subTest(args):
                said = self.doctor(emulator, service, *args)
                self.assertIn(f'{keeps}' if 'boards' in args else 'can run', said)
        self.assertIn('nobody has its lease; drive 0 and brake 0 written and read back',
                      self.doctor(emulator, service, '--only', 'boards'))
        program = self.start(emulator)
        self.wait_until_driven(emulator, program)
        self.assertIn(f'process {program.pid} (abs_hil) has its lease', self.doctor(emulator, service, '--only', 'boards'))
        self.assertIn(f'process {program.pid} (abs_hil) has the lease',
                      self.doctor(emulator, service, '--backend', 'rig', '--only', 'backend'))
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, 'questions disturb no run: ' + words)
        service.end()
        self.assertIn('none listens', self.doctor(emulator, service, '--only', 'boards'))

    def test_a_run_without_a_lease_is_told_who_keeps_the_card(self):
        emulator = self.emulator()
        service = self.service(emulator)
        result = subprocess.run(self.command(emulator, resident='off'), cwd=self.folder, capture_output=True, text=True,
                                timeout=30, check=False)
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn(f'process {service.process.pid} (abs_guardian), the resident service, keeps the card', result.stderr)
        self.assertIn('guardian.resident=require', result.stderr)

    def test_a_caller_who_says_nothing_disturbs_nobody(self):
        emulator = self.emulator()
        service = self.service(emulator)
        program = self.start(emulator)
        self.wait_until_driven(emulator, program)
        silent = [connect(service.socket) for _ in range(3)]
        self.assertIn(f'process {program.pid} (abs_hil) has its lease', self.doctor(emulator, service, '--only', 'boards'))
        _, words = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 0, words)
        for one in silent:
            one.close()

    def test_commissioning_has_one_lease_for_all_its_pulses(self):
        emulator = self.emulator()
        service = self.service(emulator)
        program = subprocess.Popen(
            [pathlib.Path(PROGRAM).resolve(), 'commission', *settings(
                f'driver.pci.root={emulator.root}', 'guardian.resident=require',
                f'guardian.socket={service.socket}', 'guardian.timeout_ms=1000')],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1)
        self._programs.append(program)

        def answer(question):
            if 'Step 2' in question:
                time.sleep(10.5)  # a holder that has no run covered within 10 s is ended
            return 'y'

        said = self.go_through_commissioning(program, emulator, answer)
        _, errors = program.communicate(timeout=20)
        self.assertEqual(program.returncode, 0, said + errors)
        wait_until(lambda: len(granted_and_ended(service.said())) % 2 == 0, 'the last lease did not end')
        # The first one is of the look whether the board is there, before the first question.
        self.assertEqual([word for word, _ in granted_and_ended(service.said())], ['granted to', 'ended:'] * 2)

    def test_service_that_ends_takes_the_outputs_back(self):
        for number, words in ((signal.SIGTERM, 'the resident guardian was told to end'),
                              (signal.SIGKILL, 'the guardian process died'),
                              # The standby ends a guard that stands still.
                              (signal.SIGSTOP, 'the guardian process died')):
            with self.subTest(signal=number.name):
                emulator = self.emulator()
                service = self.service(emulator)
                program = self.start(emulator)
                self.wait_until_driven(emulator, program)
                service.process.send_signal(number)
                _, said = program.communicate(timeout=30)
                self.assertEqual(program.returncode, 1, said)
                self.assertIn(words, said)
                self.assertEqual(emulator.wire(), SAFE)
                if number == signal.SIGTERM:
                    self.assertEqual(service.process.wait(timeout=20), 0)
                service.process.kill()
                service.process.wait()

    def test_standby_acts_when_run_and_guard_stand_still(self):
        """Both are stopped at once, or killed at once: nobody else would act. A killed standby is replaced before that."""
        times = []
        for number, standby_dies in ((signal.SIGSTOP, False), (signal.SIGKILL, False), (signal.SIGKILL, True)) * max(
                1, TRIES // 3):
            emulator = self.emulator()
            service = self.service(emulator)
            program = self.start(emulator)
            self.wait_until_driven(emulator, program)
            if standby_dies:
                for pid in service.companions():
                    os.kill(pid, signal.SIGKILL)
                time.sleep(0.01)
            before_ns = time.monotonic_ns()
            for pid in (service.process.pid, program.pid):
                os.kill(pid, number)
            times.append(self.ms_until_zero(emulator, before_ns))
            program.wait(timeout=20)
            service.process.wait(timeout=20)
            wait_until(lambda service=service: 'standby: the guard died or stood still' in service.said(), 'no standby')
            self.assertEqual(emulator.wire(), SAFE)
            self.service(emulator)
            self.assertEqual(self.start(emulator).wait(timeout=30), 0)
            self.services[-1].end()
        say_times('run and guard stopped or killed at once, by the standby', times)


class Ends(ResidentTest):
    """Each way of ending or stopping a run, in random phases."""

    def tries(self, way, end, before=(), group=None, status=(-signal.SIGKILL,)):
        times = []
        emulator = self.emulator()
        service = self.service(emulator)
        for number in range(TRIES):
            scope = Group(f'{way.replace(" ", "_")}_{number}') if group else None
            try:
                program = self.start(emulator, before=before, enter=scope.enter if scope else None)
                self.wait_until_driven(emulator, program)
                before_ns = time.monotonic_ns()
                end(program, scope or service)
                times.append(self.ms_until_zero(emulator, before_ns))
                program.wait(timeout=20)
                self.assertIn(program.returncode, status)
                self.assertEqual(emulator.wire(), SAFE)
            finally:
                if scope:
                    scope.remove()
        say_times(way, times)
        self.assertEqual(emulator.end(), 0)
        return service

    def test_sigkill(self):
        self.tries('SIGKILL', lambda program, _: program.kill())

    def test_sigstop(self):
        self.tries('SIGSTOP', lambda program, _: program.send_signal(signal.SIGSTOP))

    def test_end_of_the_whole_scope(self):
        self.need_groups()
        self.tries('cgroup.kill', lambda _, scope: scope.write('cgroup.kill', '1'), group=True)

    def test_frozen_scope(self):
        self.need_groups()
        self.tries('cgroup.freeze', lambda _, scope: scope.write('cgroup.freeze', '1'), group=True)

    def test_end_of_a_container(self):
        need_container(self)
        shell = (*CONTAINER, 'sh', '-c', '"$@"; exit 5', 'sh')
        self.tries('end of a PID namespace', self.end_first_process, before=shell, status=UNSHARE_OF_KILLED)

    def test_end_of_a_container_whose_entry_is_the_run(self):
        need_container(self)
        self.tries('end of a PID namespace, process 1', self.end_first_process, before=CONTAINER,
                   status=UNSHARE_OF_KILLED)

    @staticmethod
    def end_first_process(program, _):
        children = pathlib.Path(f'/proc/{program.pid}/task/{program.pid}/children').read_text().split()
        assert len(children) == 1, children
        os.kill(int(children[0]), signal.SIGKILL)

    def need_groups(self):
        why_not = Group.why_not()
        if why_not:
            self.skipTest(why_not)

    def test_run_and_service_together(self):
        """Somebody starts the service again; systemd does."""
        emulator = self.emulator()
        times = []
        for _ in range(TRIES):
            service = self.service(emulator)
            program = self.start(emulator)
            self.wait_until_driven(emulator, program)
            before_ns = time.monotonic_ns()
            for process in (program, service.process):
                process.kill()
                process.wait()
            self.service(emulator)
            times.append(self.ms_until_zero(emulator, before_ns))
            self.services[-1].end()
        say_times('SIGKILL of run and service, service started again', times)

    def test_without_the_service_the_card_holds(self):
        """What all this is for: the end of a scope with a guardian of the run's own in it."""
        self.need_groups()
        emulator = self.emulator()
        scope = Group('own')
        program = self.start(emulator, resident='off', enter=scope.enter)
        self.wait_until_driven(emulator, program)
        scope.remove()
        self.assertNotEqual(emulator.wire(), SAFE)


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main(verbosity=2)
