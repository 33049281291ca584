"""A run of ten minutes at 1 kHz, and a hundred runs, become a report in less than 1 GB and in not much more processor time than
their CSV files alone take to be read, in the same Python on the same computer."""
import resource
import subprocess
import sys
import unittest

from program import ABS_REPORT, ReportTest

CYCLES = 600_000
#: of the report's processor time over that of reading
LARGEST_RATIO = 1.8
#: to the last digit, as the report reads
READ = 'import sys, pandas\nfor file in sys.argv[1:]: pandas.read_csv(file, float_precision="round_trip")'


def cpu_s(words, folder):
    """The processor time of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(words, cwd=folder, check=True, capture_output=True, timeout=300)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


class LongRun(ReportTest):
    def test_ten_minutes(self):
        a = self.make_run('a')
        header, *rows = (a / 'run.csv').read_text().splitlines()
        braking = [row.split(',', 1)[1] for row in rows if row.split(',', 2)[1] == 'brake']
        with open(self.folder / 'long.csv', 'w') as file:
            file.write(header + '\n')
            for cycle in range(CYCLES):
                file.write(f'{cycle / 1000},{braking[cycle % len(braking)]}\n')
        self.assertGreater((self.folder / 'long.csv').stat().st_size, 100_000_000)
        self.judge(['long.csv'])
        self.assertLess((self.folder / 'report.html').stat().st_size, 10_000_000)

    def judge(self, files):
        seconds = cpu_s([ABS_REPORT, *files], self.folder)
        megabytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000.0
        reading_s = cpu_s([sys.executable, '-c', READ, *files], self.folder)
        print(f'{seconds:.2f} s, {seconds / reading_s:.2f} times that of reading, {megabytes:.0f} MB')
        self.assertLess(seconds, LARGEST_RATIO * reading_s)
        self.assertLess(megabytes, 1000.0)

    def test_hundred_runs(self):
        a = self.make_run('a')
        for number in range(100):
            (self.folder / f'run{number}.csv').symlink_to(a / 'run.csv')
        self.judge([file.name for file in sorted(self.folder.glob('run*.csv'))])


if __name__ == '__main__':
    unittest.main()
