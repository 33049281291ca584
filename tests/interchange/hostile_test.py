"""Controllers from files that attack, in simulation: each ends in a refusal (status 2) while it is made and in a fault
(status 1) in a step, with a reason; the program, its files and other processes are unharmed. Controllers in the program's own
process end it with status 1 at worst. FMUs and files that would fill memory or stack are refused before that.
usage: as in foreign.py, and then the program of own_hostile.cpp"""
import ctypes
import errno
import os
import pathlib
import resource
import struct
import subprocess
import sys
import time
import unittest
import zipfile

from foreign import hostile  # first: it reads the arguments

from program import PROGRAM, ProgramTest

OWN = sys.argv.pop(1)
FORBIDDEN = 'asked for the system call'
# deed: words of the reason
DEEDS = {'FORK_BOMB': FORBIDDEN, 'DAEMON': FORBIDDEN, 'CLONE_RAW': '(clone)', 'SHELL': '(execve)', 'NETWORK': 'Aborted',
         'SYSTEM': 'probably to start a process',
         'OTHER_SOCKETS': 'Aborted', 'KILLS_PARENT': '(kill)', 'STOPS_PARENT': '(kill)', 'KILLS_ALL': '(kill)',
         'SIGNALS_BY_OWNER': '(fcntl)', 'LEAVES_PARENT': '(prctl)', 'TRACES': '(ptrace)', 'LIMITS_PARENT': '(prlimit64)',
         'PRIORITY': '(sched_setscheduler)', 'NAMESPACE': '(unshare)', 'THREADS': 'threads', 'MEMORY': 'Segmentation fault',
         'SHARED_MEMORY': 'Segmentation fault', 'SEGMENT': 'Aborted', 'BIG_FILE': 'File size limit exceeded',
         'DELETES': 'Aborted', 'SWEEP': 'Aborted', 'ESCAPES': 'Aborted', 'CLOSES': 'closed its connection', 'FORGES': 'an answer of', 'PRINTS': 'did not answer in time',
         'STOPS_ITSELF': 'did not answer in time', 'EXITS': 'ended its process with status 0',
         'EXITS_AT_ONCE': 'ended its process with status 0', 'EXITS_QUICKLY': 'ended its process with status 0',
         'ENDS_THREAD': 'Aborted', 'ABORTS': 'Aborted', 'LOOPS': 'did not answer in time',
         'SLOW': 'too slow'}
# Their end while they are made differs, or takes the 20 s of a slow start.
SLOW_TO_MAKE = {'ENDS_THREAD', 'PRINTS', 'STOPS_ITSELF', 'LOOPS', 'SLOW', 'THREADS'}


def with_environment(text):
    """Processes that inherited it."""
    found = []
    for path in pathlib.Path('/proc').glob('[0-9]*/environ'):
        try:
            if text in path.read_bytes().split(b'\0'):
                found.append(path.parent.name)
        except OSError:
            pass  # it ended meanwhile
    return found


def facts_of(file):
    """All that a system call could change of it, but the time of reading."""
    facts = file.stat()
    return (file.read_text(), facts.st_mode, facts.st_uid, facts.st_gid, facts.st_nlink, facts.st_mtime_ns, facts.st_ctime_ns,
            os.listxattr(file))


def without_landlock():
    """Called in a child: the kernel answers as one without Landlock."""
    load_number, jump_equal, give, landlock_create_ruleset = 0x20, 0x15, 0x06, 444
    code = b''.join(struct.pack('HBBI', *statement) for statement in (
        (load_number, 0, 0, 0), (jump_equal, 0, 1, landlock_create_ruleset), (give, 0, 0, 0x00050000 | errno.ENOSYS),
        (give, 0, 0, 0x7FFF0000)))
    statements = ctypes.create_string_buffer(code, len(code))
    program = struct.pack('HxxxxxxP', len(code) // 8, ctypes.addressof(statements))
    libc = ctypes.CDLL(None, use_errno=True)
    no_new_privileges, set_seccomp, filter_mode = 38, 22, 2
    if libc.prctl(no_new_privileges, 1, 0, 0, 0) != 0 or libc.prctl(set_seccomp, filter_mode, program, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), 'prctl')


class Hostile(ProgramTest):
    def test_without_landlock_a_person_must_accept_that_files_may_change(self):
        library = hostile(self.folder, 'ABORTS', 'AT_STEP=1000000')
        run = [PROGRAM, '--controller', library, '--fast', '--no-lcm', '--no-out', '--set',
               'experiment.start_speed_rad_s=20']
        refused = subprocess.run(run, capture_output=True, text=True, preexec_fn=without_landlock, timeout=60)
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertIn('no Landlock', refused.stderr)
        self.assertIn('unsafe.foreign_files=true', refused.stderr)
        for consent, enter in ((['--set', 'unsafe.foreign_files=true'], without_landlock), ([], None)):
            accepted = subprocess.run(run + consent, capture_output=True, text=True, preexec_fn=enter, timeout=60)
            self.assertIn(accepted.returncode, (0, 1), accepted.stderr)
            self.assertNotIn('Landlock', accepted.stderr)

    def attack(self, library, *options):
        """Status, standard error; every process that the code started is gone, and nobody holds our pipe."""
        kept = pathlib.Path('/var/tmp', f'{library.stem}-{os.getpid()}')  # outside the folder for temporary files
        kept.write_text('dear to somebody')
        before = facts_of(kept)
        mark = {'HOSTILE_FILE': str(kept), 'HOSTILE_BIG_FILE': str(self.folder / 'big')}
        try:
            program = subprocess.Popen([PROGRAM, '--controller', library, '--fast', '--no-lcm', '--set',
                                        'experiment.start_speed_rad_s=170', *map(str, options)], text=True,
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, **mark})
            _, errors = program.communicate(timeout=60)  # returns when nobody holds the pipes any more
            self.assertEqual(facts_of(kept), before)
            self.assertNotRegex(errors, r'[\x00-\x08\x0b-\x1f\x7f-\x9f]')
            self.assertEqual(with_environment(f'HOSTILE_FILE={kept}'.encode()), [])
        finally:
            kept.unlink(missing_ok=True)
        return program.returncode, errors

    def test_a_deed_in_a_step_is_a_fault(self):
        for deed, words in DEEDS.items():
            with self.subTest(deed):
                out = self.folder / deed
                status, errors = self.attack(hostile(self.folder, deed, 'AT_STEP=100'), '--out', out)
                self.assertEqual(status, 1, errors)
                summary = self.summary(out / 'summary.json')
                self.assertEqual(summary['result'], 'fault')
                self.assertIn(words, summary['reason'])
                self.assertTrue((out / 'SHA256SUMS').exists())
                self.assertLess(len(errors), 100_000)

    def test_a_deed_while_it_is_made_is_a_refusal(self):
        for deed, words in DEEDS.items():
            for place in ('IN_CONSTRUCTOR', 'IN_CREATE'):
                if deed not in SLOW_TO_MAKE:
                    with self.subTest(deed, place=place):
                        status, errors = self.attack(hostile(self.folder, deed, place))
                        self.assertEqual(status, 2, errors)
                        self.assertIn(words, errors)


    def test_its_process_ends_with_the_program(self):
        mark = str(self.folder / 'mark')
        with subprocess.Popen([PROGRAM, '--controller', hostile(self.folder, 'LOOPS', 'AT_STEP=100'), '--fast', '--no-lcm'],
                              stderr=subprocess.DEVNULL, env={**os.environ, 'HOSTILE_FILE': mark}) as program:
            while len(with_environment(f'HOSTILE_FILE={mark}'.encode())) < 2:
                pass
            program.kill()
        end = time.monotonic() + 10
        while with_environment(f'HOSTILE_FILE={mark}'.encode()):
            self.assertLess(time.monotonic(), end)


class OwnProcess(ProgramTest):
    """Controllers that are part of the program."""

    def test_the_program_ends_by_its_own_decision(self):
        real_time = ('--no-lcm', '--no-out', '--rt', 'off', '--set', 'experiment.start_speed_rad_s=170')
        called = 'called exit() or quick_exit()'
        for name, options, words in (('exits', ('--fast',), called), ('exits', (), called), ('exits-quickly', ('--fast',), called),
                                     ('exits-at-once', ('--fast',), 'called _exit()'), ('exits-at-once', (), 'called _exit()'),
                                     ('execs', ('--fast',), "in this one's place"), ('execs', (), "in this one's place"),
                                     ('loops', ('--fast',), 'a cycle takes more than 5 s'),
                                     ('loops', (), 'a cycle takes more than 5 s'),
                                     ('slow', ('--fast',), 'too slow')):
            with self.subTest(name, options=options):
                result = subprocess.run([OWN, '--controller', name, *real_time, *options], capture_output=True, text=True, timeout=60)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertIn(words, result.stderr)

    def test_a_child_of_foreign_code_ends_alone(self):
        """It neither touches the parent's board nor speaks for it."""
        for name in ('forks', 'forks-and-exits'):
            with self.subTest(name):
                result = subprocess.run([OWN, '--controller', name, '--fast', '--no-lcm', '--no-out'], capture_output=True,
                                        text=True, timeout=60)
                self.assertNotIn('outputs are safe', result.stderr)
                self.assertNotIn('called', result.stderr)
                self.assertEqual(result.returncode, 0, result.stderr)

    def test_in_a_comparison_too(self):
        # Its tables are made by a program in Python, which an own program finds in the PATH.
        path = f'{pathlib.Path(PROGRAM).parent}:{os.environ["PATH"]}'
        result = subprocess.run([OWN, 'compare', '--controllers', 'exits', '--repeat', '2'], capture_output=True, text=True,
                                timeout=60, env={**os.environ, 'PATH': path})
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('called exit()', result.stderr)
        self.assertNotIn('destroyed', result.stderr, 'the other run still uses it')


class Files(ProgramTest):
    def refused(self, words, *arguments):
        """Status 2 and one line, with little memory and before long."""
        def little_memory():
            resource.setrlimit(resource.RLIMIT_DATA, (200 << 20, 200 << 20))
        with subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                              preexec_fn=little_memory) as program:
            errors = program.stderr.read()
            _, status, used = os.wait4(program.pid, 0)
            program.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(program.returncode, 2, errors)
        self.assertEqual(len(errors.splitlines()), 1, errors)
        self.assertIn(words, errors)
        self.assertLess(used.ru_utime + used.ru_stime, 2.0)  # 0.3 s at most on the computer of the first tests; 52 s once

    def test_an_fmu_that_is_small_and_unpacks_to_much(self):
        head = '<fmiModelDescription fmiVersion="2.0" guid="a"><CoSimulation modelIdentifier="x"/>'
        for name, inner, files, words in (('tags', '<a/>' * (60 << 20), 0, '251658'), ('elements', '<a/>' * (3 << 20), 0, '200000 elements'),
                                          ('attributes', '<a ' + 'a="" ' * (3 << 20) + '/>', 0, '1000000 attributes'),
                                          ('levels', '<a>' * (1 << 20) + '</a>' * (1 << 20), 0, '64 levels'),
                                          ('comment', '<!-- ' + '<a>' * 99 + ' --><b a="/>' + '<a' * 99 + '"/>', 0, 'not a shared library'),
                                          ('files', '', 9900, '9902 files')):
            with self.subTest(name):
                path = self.folder / f'{name}.fmu'
                with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
                    archive.writestr('modelDescription.xml', f'{head}{inner}<ModelVariables><ScalarVariable name="brake_torque_Nm" '
                                     'valueReference="0" causality="output"><Real/></ScalarVariable><ScalarVariable name="slip" '
                                     'valueReference="1" causality="input"><Real/>'
                                     '</ScalarVariable></ModelVariables></fmiModelDescription>')
                    archive.writestr('binaries/linux64/x.so', b'x')
                    for n in range(files):
                        archive.writestr(f'resources/{n}', b'')
                self.refused(words, '--fast', '--no-lcm', '--controller', path)

    def test_toml_that_nests_too_deep(self):
        for name, text, words in (('name', f'[{"a." * 50_000}a]\n', '16 parts'), ('key', f'{"a." * 50_000}a = 1\n', '16 parts'),
                                  ('array', f'a = {"[" * 200_000}\n', '64 levels'), ('table', f'a = {"{a=" * 200_000}\n', '64 levels')):
            path = self.folder / f'{name}.toml'
            path.write_text(text)
            run = ('--fast', '--no-lcm')
            for arguments in ((*run, '--config', path), (*run, '--plant', path), (*run, '--experiment', path), ('validate', path),
                              ('study', path)):
                with self.subTest(name, arguments=arguments):
                    self.refused(words, *arguments)


if __name__ == '__main__':
    unittest.main()
