"""What the system, the loader and other programs say is told with its cause and the fix, and what is no error is not told.

usage: words_test.py ABS_HIL
"""
import os
import pathlib
import shutil
import stat
import subprocess
import unittest

from program import PATIENT, PROGRAM, ProgramTest

START = ('--set', 'experiment.start_speed_rad_s=170')
STUDY = 'chunk = 1\n[factors]\nplant.theta_N = { from = 20, to = 25, steps = %d }\n'
CC = shutil.which('cc') or shutil.which('gcc') or shutil.which('clang')
SOURCE = pathlib.Path(__file__).parents[2]


class Outputs(ProgramTest):
    def to_nobody(self, *words, stderr=subprocess.PIPE):
        """Runs the program while nobody reads its stdout."""
        nobody, out = os.pipe()
        os.close(nobody)
        try:
            return subprocess.run([PROGRAM, *map(str, words)], stdout=out, stderr=out if stderr is None else stderr, text=True,
                                  timeout=60)
        finally:
            os.close(out)

    def test_a_reader_that_ends_early_is_no_error(self):
        self.fast('--out', self.folder / 'run', *START)
        study = self.folder / 'study.toml'
        study.write_text(STUDY % 3)
        folder = ('--out', self.folder / 'study')
        for words in (['list'], ['list', '--keys'], ['list', '--reasons'], ['list', '--quantities'], ['list', '--json', '--keys'],
                      ['--help'], ['--version'], ['validate', '--schema'], ['validate', 'paper'], ['doctor'], ['doctor', '--json'],
                      ['--fast', '--no-lcm', *START], ['compare', '--controllers', 'pi', '--repeat', '2'],
                      ['study', study, *folder], ['study', 'status', folder[1]],
                      ['study', 'merge', folder[1]], ['replay', self.folder / 'run'],
                      ['convert', self.folder / 'run/run.lcmlog', self.folder / 'run.csv']):
            with self.subTest(words):
                read = self.run_program(*words)
                result = self.to_nobody(*words)
                self.assertEqual(result.returncode, read.returncode, result.stderr)
                self.assertNotIn('Broken pipe', result.stderr)
                self.assertNotIn('cannot write', result.stderr)
                self.assertNotIn('standard output', result.stderr)
        self.assertEqual(self.to_nobody('list', '--keys', stderr=None).returncode, 0)
        self.assertEqual(self.to_nobody('validate', 'nothing', stderr=None).returncode, 2)

    def test_the_work_is_done_although_nobody_reads_of_it(self):
        study, out = self.folder / 'study.toml', self.folder / 'study'
        study.write_text(STUDY % 3)
        self.assertEqual(self.to_nobody('study', study, '--out', out).returncode, 0)
        self.assertIn('complete', self.run_program('study', 'status', out).stdout)

    def test_a_full_disk_is_told_with_its_cause(self):
        for words in (['list', '--keys'], ['validate', '--schema'], ['list']):
            with open('/dev/full', 'w') as full:
                result = subprocess.run([PROGRAM, *words], stdout=full, stderr=subprocess.PIPE, text=True)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertRegex(result.stderr, 'cannot write to standard output: No space left on device; free some space')


class Folders(ProgramTest):
    def run_in(self, *words, **environment):
        return self.run_program('--no-lcm', '--rt', 'off', '--set', 'experiment.start_speed_rad_s=20', *words, cwd=self.folder,
                                env={**os.environ, 'ABS_HIL_RUNS_DIR': 'runs', **environment})

    def test_names_of_run_folders_are_cut_and_keep_their_letters(self):
        for name, part in (('a' * 250, 'aaa'), ('动' * 83, '动动'), ('Übergang à Łódź', '-Ubergang-a-Lodz'), ('опыт 1', '-opyt-1')):
            with self.subTest(name):
                script = self.folder / f'{name}.toml'
                script.write_text((SOURCE / 'config/experiments/brake-step.toml').read_text())
                result = self.run_in('--experiment', script)
                self.assertIn('run folder', result.stdout, result.stderr)
                folder = pathlib.Path(self.folder, result.stdout.split('run folder')[1].split('\n')[0].strip())
                self.assertIn(part, folder.name)
                self.assertLessEqual(len(folder.name.encode()), 255)
                self.assertTrue((folder / 'SHA256SUMS').exists())

    def test_runs_that_begin_in_the_same_second_have_a_folder_each(self):
        runs = [subprocess.Popen([pathlib.Path(PROGRAM).resolve(), *PATIENT, '--no-lcm', '--rt', 'off', *START], cwd=self.folder,
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                 env={**os.environ, 'ABS_HIL_RUNS_DIR': 'runs', 'TZ': 'No/Where'}) for _ in range(4)]
        for run in runs:
            self.assertEqual(run.wait(timeout=60), 0)
        self.assertEqual(len(list(self.folder.glob('runs/*/SHA256SUMS'))), 4)

    def test_controllers_of_one_name_have_a_folder_each(self):
        result = self.run_program('compare', '--controllers', 'ä=pi,a=pi,制=pi', '--repeat', '1', '--run', '0', '--out',
                                  self.folder / 'out')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(sorted(path.name for path in (self.folder / 'out').iterdir()), ['a', 'a-2', '制'])

    def test_a_flight_record_stays_out_of_the_current_folder(self):
        fault = ('--fast', '--no-lcm', '--set', 'experiment.accelerate_limit_s=2')
        here = self.folder / 'here'
        here.mkdir()
        for words, places in ((('--csv', 'run.csv'), ['state/abs_hil/recorder']), (('--log', 'run.lcmlog'), ['state/abs_hil/recorder']),
                              (('--csv', '/dev/null'), ['state/abs_hil/recorder']), (('--recorder', '../after'), ['after']),
                              (('--csv', '../named/run.csv'), ['named']), (('--out', '../out'), ['out']), ((), [])):
            with self.subTest(words):
                for name in ('state', 'after', 'named', 'out'):
                    shutil.rmtree(self.folder / name, ignore_errors=True)
                (self.folder / 'named').mkdir()
                result = self.run_program(*fault, *words, cwd=here)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertEqual([path.name for path in here.glob('recorder*')], [])
                records = {str(path.parent.relative_to(self.folder)) for path in self.folder.rglob('recorder*.txt')}
                self.assertEqual(records, set(places))


class Files(ProgramTest):
    def fmu(self):
        path = self.folder / 'law.fmu'
        self.assertEqual(self.run_program('export-fmu', '--controller', 'adaptive', '--out', path).returncode, 0)
        return path

    def test_a_folder_for_temporary_files_that_cannot_be_used_is_named(self):
        law, file = self.fmu(), self.folder / 'file'
        file.touch()
        for place in ('/nonexistent/job.1', file, 'gone', '/proc'):
            result = self.run_program('--fast', '--no-lcm', '--controller', law, env={**os.environ, 'TMPDIR': str(place)},
                                      cwd=self.folder)
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assertIn(str(place), result.stderr)
            self.assertIn('TMPDIR', result.stderr)

    def test_any_folder_for_temporary_files_serves(self):
        """Also a relative one, from which an URI of the standard must be made, and none."""
        law, names = self.fmu(), self.folder / 'map.toml'
        names.write_text('[outputs]\nbrake_torque_ref_Nm = "brake_torque_Nm"\n[inputs]\nupper_counts = "start"\nlower_counts = "start"\n')
        (self.folder / 'a %41').mkdir()
        for place in ('a %41', self.folder / 'a %41', '.', ''):
            result = self.run_program('--fast', '--no-lcm', '--no-out', '--controller', law, *START, '--set', 'plant.ideal_sensors=true',
                                      '--set', f'control.foreign.mapping={names}', env={**os.environ, 'TMPDIR': str(place)}, cwd=self.folder)
            self.assertIn('stop time', result.stdout, (place, result.stderr))

    @unittest.skipUnless(CC, 'no compiler for C')
    def test_what_the_loader_says_has_a_cause_and_a_fix(self):
        source, good = self.folder / 'law.c', self.folder / 'good.so'
        source.write_text('int g(void);\nint f(void) { return g(); }\n')
        subprocess.run([CC, '-shared', '-fPIC', '-o', good, source], check=True)
        head = good.read_bytes()
        machine = b'\xb7' if head[18] == 0x3E else b'\x3e'
        for name, content, words in (('undefined', head, 'link the library that defines it'),
                                     ('cut', head[:len(head) // 3], 'cut off'), ('text', b'hello', 'no library for Linux'),
                                     ('bits', head[:4] + b'\x01' + head[5:], '32 bits'),
                                     ('processor', head[:18] + machine + head[19:], 'another processor')):
            with self.subTest(name):
                path = self.folder / f'{name}.so'
                path.write_bytes(content)
                result = self.run_program('--fast', '--no-lcm', '--controller', path)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(words, result.stderr)

    @unittest.skipUnless(CC and os.geteuid() == 0 and subprocess.run(['unshare', '-m', 'true'], capture_output=True).returncode == 0,
                         'only root can mount')
    def test_a_folder_without_programs_is_named(self):
        law = SOURCE / 'examples/c_controller/pi_controller.c'
        subprocess.run([CC, '-shared', '-fPIC', f'-I{SOURCE / "include"}', '-o', self.folder / 'law.so', law, '-lm'], check=True)
        place = self.folder / 'noexec'
        place.mkdir()
        self.fmu()
        for controller in (place / 'law.so', self.folder / 'law.fmu'):
            script = (f'mount -t tmpfs -o noexec none {place} && cp {self.folder}/law.so {place} && TMPDIR={place} '
                      f'{pathlib.Path(PROGRAM).resolve()} --fast --no-lcm --controller {controller} --set control.foreign.mapping=map.toml')
            (self.folder / 'map.toml').write_text('[outputs]\nbrake_torque_ref_Nm = "brake_torque_Nm"\n[inputs]\n'
                                                  'upper_counts = "start"\nlower_counts = "start"\n')
            result = subprocess.run(['unshare', '-m', 'sh', '-c', script], capture_output=True, text=True, cwd=self.folder)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in ('noexec', 'TMPDIR', str(place)):
                self.assertIn(word, result.stderr)


class Slurm(ProgramTest):
    """Programs of a cluster as this test wants them to answer."""

    def submit(self, answer, status, *words, config='MaxArraySize            = 1001'):
        tools = self.folder / 'tools'
        tools.mkdir(exist_ok=True)
        for name, text in (('sbatch', f'cp "$(eval echo \\${{$#}})" {self.folder}/last.sh; {answer}; exit {status}'),
                           ('scontrol', f'echo "{config}"')):
            (tools / name).write_text(f'#!/bin/sh\n{text}\n')
            (tools / name).chmod(stat.S_IRWXU)
        study = self.folder / 'study.toml'
        study.write_text(STUDY % 3000)
        return self.run_program('study', 'submit', study, '--out', self.folder / 'out', *words,
                                env={**os.environ, 'PATH': f'{tools}:{os.environ["PATH"]}'})

    def test_arrays_are_as_large_as_the_cluster_takes_them(self):
        for config, tasks in (('MaxArraySize            = 1001', 1000), ('MaxArraySize=11', 10), ('Other = 5', 2000)):
            result = self.submit('echo "sbatch: info: queued" >&2; echo 4711', 0, '--array', 2000, config=config)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(f'in {tasks} tasks of job 4711', result.stdout)
            script = (self.folder / 'out/slurm/array.sh').read_text()
            self.assertIn(f'#SBATCH --array=1-{tasks}\n', script)
            self.assertIn(f'/{tasks}"', script)
            self.assertEqual('MaxArraySize' in result.stderr and '--array 2000' in result.stderr, tasks != 2000)
            self.assertIn('queued', result.stderr)

    def test_what_sbatch_refuses_is_told_with_the_fix(self):
        for words, fix in (('Batch job submission failed: Invalid job array specification', '--array'),
                           ('Batch job submission failed: QOSMaxSubmitJobPerUserLimit', '--array'),
                           ('invalid partition specified: x', '--partition'), ('Unable to contact slurm controller', 'scontrol ping'),
                           ('Batch job submission failed: Invalid account or account/partition combination', '--account'),
                           ('some other words', 'after --')):
            result = self.submit(f'echo "sbatch: error: {words}" >&2', 1, '--array', 5)
            self.assertEqual(result.returncode, 3, result.stderr)
            self.assertIn(words, result.stderr)
            self.assertIn(fix, result.stderr)
            self.assertEqual(len(result.stderr.splitlines()), 1)


if __name__ == '__main__':
    unittest.main()
