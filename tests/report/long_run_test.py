"""A run of ten minutes at 1 kHz becomes a report in less than 10 s of processor time and 1 GB."""
import resource
import subprocess
import unittest

from program import ABS_REPORT, ReportTest

CYCLES = 600_000


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
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([ABS_REPORT, 'long.csv'], cwd=self.folder, check=True, capture_output=True, timeout=120)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        megabytes = after.ru_maxrss / 1000.0
        size = (self.folder / 'report.html').stat().st_size
        print(f'{seconds:.2f} s, {megabytes:.0f} MB, page of {size / 1e6:.1f} MB')
        self.assertLess(seconds, 10.0)
        self.assertLess(megabytes, 1000.0)
        self.assertLess(size, 10_000_000)

    def test_hundred_runs(self):
        a = self.make_run('a')
        for number in range(100):
            (self.folder / f'run{number}.csv').symlink_to(a / 'run.csv')
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        self.report(*sorted(self.folder.glob('run*.csv')))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        print(f'{seconds:.2f} s, {after.ru_maxrss / 1000.0:.0f} MB')
        self.assertLess(seconds, 40.0)
        self.assertLess(after.ru_maxrss / 1000.0, 1000.0)


if __name__ == '__main__':
    unittest.main()
