"""abs_tune as users run it: gains that abs_hil reads, the same with any number of threads, bad input refused."""
import re
import subprocess
import sys
import unittest

TUNE = sys.argv.pop(2)
from program import ProgramTest  # noqa: E402, takes the other argument

SMALL = {'--controllers': 'sliding-mode', '--plants': 'paper-table1', '--cases': 1, '--generations': 2}


class Tune(ProgramTest):
    def tune(self, folder, changed=None):
        options = SMALL | (changed or {}) | {'--folder': self.folder / folder}
        return subprocess.run([TUNE, *(str(word) for option in options.items() for word in option)],
                              capture_output=True, text=True, timeout=120, check=False)

    def test_gains_are_a_configuration_and_no_worse_than_those_before(self):
        result = self.tune('')
        self.assertEqual(result.returncode, 0, result.stderr)
        file = self.folder / 'sliding-mode.toml'
        self.assertIn(file.read_text(), result.stdout)
        cost, before = map(float, re.search(r'cost ([\d.]+), with the previous gains ([\d.]+)', result.stdout).groups())
        self.assertLessEqual(cost, before)
        self.assertEqual(re.findall(r'generation (\d+) of 2', result.stderr)[-1], '2')
        gains = dict(re.findall(r'^(\w+) = ([-\d.e+]+)$', file.read_text(), re.MULTILINE))
        self.assertTrue(gains)
        self.fast('--config', file, '--controller', 'sliding-mode', '--summary', self.folder / 'summary.json')
        tuned = self.summary(self.folder / 'summary.json')['config']['control']['sliding_mode']
        for name, value in gains.items():
            self.assertEqual(tuned[name], float(value))

    def test_threads_change_nothing_and_the_seed_does(self):
        texts = []
        for number, changed in enumerate(({'--threads': 1}, {'--threads': 3}, {'--threads': 1, '--seed': 9})):
            self.assertEqual(self.tune(str(number), changed).returncode, 0)
            text = (self.folder / str(number) / 'sliding-mode.toml').read_text()
            texts.append([line for line in text.splitlines() if not line.startswith('#')])
        self.assertEqual(texts[0], texts[1])
        self.assertNotEqual(texts[0], texts[2])

    def test_bad_input_is_named_and_nothing_written(self):
        for option, value, words in (('--controllers', 'slidng-mode', 'slidng-mode'),
                                     ('--plants', 'paper-tabel1', 'paper-tabel1'), ('--cases', 0, '--cases'),
                                     ('--generations', 'many', '--generations'), ('--sed', 1, '--sed')):
            result = self.tune('', {option: value})
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(words, result.stderr)
            self.assertEqual(list(self.folder.iterdir()), [])
        (self.folder / 'no-folder').write_text('')
        result = self.tune('no-folder')
        self.assertEqual(result.returncode, 2)
        self.assertIn('no-folder', result.stderr)


if __name__ == '__main__':
    unittest.main()
