"""usage: help_test.py PROGRAM: what every program and subcommand says of itself, beside PROGRAM."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

FOLDER = pathlib.Path(sys.argv.pop(1)).resolve().parent
#: not for people, or without an option
NOT_STARTED = ('abs_hil_program', 'abs_python_host')


def run(*words, columns=80, status=0):
    told = subprocess.run([FOLDER / words[0], *words[1:]], capture_output=True, text=True, check=False,
                          env={**os.environ, 'COLUMNS': str(columns)})
    if told.returncode != status:
        raise AssertionError(f'{words}: status {told.returncode}, {told.stderr}')
    return told.stderr if status else told.stdout


class Help(unittest.TestCase):
    def setUp(self):
        self.programs = [file.name for file in sorted(FOLDER.glob('abs_*')) if file.name not in NOT_STARTED]
        self.assertIn('abs_hil', self.programs)
        self.subcommands = re.findall(r'^  ([a-z][a-z-]*)', run('abs_hil', '--help').partition('Subcommands:')[2], re.MULTILINE)
        self.assertGreater(len(self.subcommands), 20)

    def commands(self):
        yield from ((name, '--help') for name in self.programs if name != 'abs_controller_host')
        yield from (('abs_hil', name, '--help') for name in self.subcommands)
        yield from (('abs_hil', 'study', name, '--help') for name in ('merge', 'status', 'submit'))
        yield ('abs_guardian', 'serve', '--help')

    def test_no_word_is_cut(self):
        for words in self.commands():
            whole = run(*words, columns=1000)
            for columns in (80, 60):
                with self.subTest(words, columns=columns):
                    told = run(*words, columns=columns)
                    self.assertEqual(told.split(), whole.split())
                    for line in told.splitlines():
                        self.assertLessEqual(len(line), max(columns, *(len(word) for word in line.split() or [''])), line)

    def test_help_of_a_subcommand_by_the_word_help(self):
        self.assertEqual(run('abs_hil', 'help'), run('abs_hil', '--help'))
        self.assertEqual(run('abs_hil', 'help', 'study'), run('abs_hil', 'study', '--help'))
        self.assertEqual(run('abs_hil', 'help', 'study', 'merge'), run('abs_hil', 'study', 'merge', '--help'))
        for name in self.subcommands:
            with self.subTest(name):
                self.assertEqual(run('abs_hil', 'help', name), run('abs_hil', name, '--help'))
        self.assertIn('unknown subcommand nonsense', run('abs_hil', 'help', 'nonsense', status=2))

    def test_version_names_program_version_and_commit(self):
        of_abs_hil = run('abs_hil', '--version')
        facts = re.fullmatch(r'abs_hil (\d+\.\d+\.\d+)( \([0-9a-f]{7,40}(-dirty)?\))?\n', of_abs_hil)
        self.assertIsNotNone(facts, of_abs_hil)
        for name in self.programs:
            with self.subTest(name):
                self.assertEqual(run(name, '--version'), of_abs_hil.replace('abs_hil', name, 1))

    def test_words_that_people_try(self):
        for words in (('run',), ('simulate',), ('--fast', 'run', 'paper'), ('run', '--help'), ('help', 'simulate')):
            with self.subTest(words):
                told = run('abs_hil', *words, status=2)
                self.assertEqual(told.count('\n'), 1)
                self.assertIn('`abs_hil --fast`', told)
                self.assertIn('`abs_hil --backend sim`', told)
        for word, near in {'repot': 'report', 'ident': 'identify', 'conver': 'convert', 'stdy': 'study', 'benchmarks': 'benchmark'}.items():
            with self.subTest(word):
                self.assertIn(f'unknown subcommand {word}; the nearest is {near};', run('abs_hil', word, status=2))

    def test_commission_without_a_board_asks_nothing(self):
        for args in ((), ('--set', 'driver.kind=usb'), ('--set', 'driver.kind=hm2', '--set', 'driver.hm2.address=127.0.0.1:9')):
            with self.subTest(args):
                told = subprocess.run([FOLDER / 'abs_hil', 'commission', *args], input='y\n', capture_output=True, text=True,
                                      check=False)
                self.assertEqual((told.returncode, told.stdout), (3, ''))
                self.assertNotIn('power', told.stderr.replace("board's power", '').replace('its power', ''))
                self.assertEqual(told.stderr.count('\n'), 1, told.stderr)


if __name__ == '__main__':
    unittest.main()
