"""The outputs of a run: CSV, summary, event log, text on stdout."""
import hashlib
import json
import math
import os
import pathlib
import stat
import subprocess
import unittest

from program import PROGRAM, ProgramTest

HEADER = ('time_s,phase,omega1_rad_s,omega2_rad_s,omega1_est_rad_s,omega2_est_rad_s,slip,slip_est,slip_ref,'
          'brake_torque_Nm,brake_torque_ref_Nm,brake_torque_est_Nm,brake_pwm,motor_pwm,motor_enable,theta_N,'
          'theta_est_N,distance_m,slip_velocity_error_m_s,upper_counts,lower_counts,sample_valid,sample_time_s,'
          'wheels_apart')
PHASES = ['idle', 'accelerate', 'coast', 'brake', 'hold', 'stopped']


class Outputs(ProgramTest):
    def test_csv(self):
        path = self.folder / 'run.csv'
        self.fast('--csv', path)
        self.assertEqual(path.read_text().splitlines()[0], HEADER + ',I_m,omega1_hat_rad_s,zeta_N,V,V_dot')
        rows = self.rows(path)
        seen = list(dict.fromkeys(row['phase'] for row in rows))
        self.assertEqual(seen, PHASES)
        self.assertEqual(float(rows[0]['time_s']), 0.0)
        steps = [float(b['time_s']) - float(a['time_s']) for a, b in zip(rows, rows[1:])]
        self.assertLess(max(abs(step - 1e-3) for step in steps), 1e-9)
        for row in rows:
            self.assertGreaterEqual(float(row['omega1_rad_s']), 0.0)
            self.assertGreaterEqual(float(row['omega2_rad_s']), 0.0)
            if row['phase'] != 'brake':
                self.assertTrue(math.isnan(float(row['theta_est_N'])))

    def test_summary_agrees_with_the_csv(self):
        csv, summary = self.folder / 'run.csv', self.folder / 'summary.json'
        self.fast('--csv', csv, '--summary', summary)
        rows, s = self.rows(csv), self.summary(summary)
        braking = [i for i, row in enumerate(rows) if row['phase'] == 'brake']
        first = braking[0]
        self.assertAlmostEqual(s['brake_start_s'], float(rows[first]['time_s']), places=9)
        # Recomputed from the rows by the definitions of docs/telemetry.md.
        v = [0.099 * float(row['omega2_rad_s']) for row in rows]
        t = [float(row['time_s']) for row in rows]
        stop = next(i for i in range(first, len(rows)) if v[i] < 0.3)
        self.assertAlmostEqual(s['stop_time_s'], t[stop] - t[first], places=9)
        distance = sum((v[i] + v[i - 1]) / 2 * (t[i] - t[i - 1]) for i in range(first + 1, stop + 1))
        self.assertAlmostEqual(s['stop_distance_m'], distance, places=6)
        squares = [(float(rows[i]['slip']) - 0.15) ** 2 for i in braking if t[i] - t[first] > 0.3 and v[i] > 3]
        self.assertAlmostEqual(s['slip_rms'], math.sqrt(sum(squares) / len(squares)), places=6)
        self.assertEqual(s['cycles'], len(rows))
        self.assertEqual((s['overruns'], s['telemetry_drops']), (0, 0))
        self.assertEqual(s['result'], 'completed')
        self.assertEqual(s['config']['plant']['theta_N'], 23.0)

    def test_effective_configuration_feeds_back(self):
        summary = self.folder / 'summary.json'
        config = self.folder / 'config.toml'
        config.write_text('[control]\nslip_ref = 0.2\n[control.adaptive]\nka1 = 2\n')
        self.fast('--config', config, '--set', 'control.adaptive.ka1=3', '--slip-ref', '0.1', '--summary', summary)
        control = self.summary(summary)['config']['control']
        self.assertEqual((control['slip_ref'], control['adaptive']['ka1']), (0.1, 3.0))

    def test_same_seed_same_bytes(self):
        def digest(seed, rate):
            csv, log = self.folder / 'run.csv', self.folder / 'run.lcmlog'
            self.fast('--seed', seed, '--rate', rate, '--csv', csv, '--log', log)
            return [hashlib.sha256(path.read_bytes()).hexdigest() for path in (csv, log)]
        for rate in (1000, 3000):
            self.assertEqual(digest(7, rate), digest(7, rate))
        self.assertNotEqual(digest(7, 1000)[0], digest(8, 1000)[0])

    def test_rates(self):
        for rate in (100, 10000):
            summary = self.folder / 'summary.json'
            self.fast('--rate', rate, '--summary', summary)
            self.assertAlmostEqual(self.summary(summary)['stop_time_s'], 2.33, delta=0.05)

    def test_plants(self):
        summary = self.folder / 'summary.json'
        self.fast('--plant', 'paper-timing', '--summary', summary)
        self.assertAlmostEqual(self.summary(summary)['stop_time_s'], 1.2, delta=0.05)

    def test_full_disk_is_said(self):
        result = self.run_program('--fast', '--no-lcm', '--csv', '/dev/full')
        self.assertEqual(result.returncode, 1)
        self.assertIn('/dev/full', result.stderr)
        self.assertIn('stop distance', result.stdout)

    def test_results_replace_regular_files_only(self):
        real, link, pipe = self.folder / 'real', self.folder / 'link', self.folder / 'pipe'
        link.symlink_to(real)
        os.mkfifo(pipe)
        (self.folder / 'older').write_text('older')
        device = self.folder / 'null'
        try:
            os.mknod(device, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
        except PermissionError:
            device = pathlib.Path('/dev/null')
        comparison = ('compare', '--controllers', 'pi', '--repeat', '1')
        commands = [(('--fast', '--no-lcm', option), 0) for option in ('--csv', '--log', '--summary')]
        commands += [((*comparison, option), 0) for option in ('--json', '--csv', '--markdown', '--runs')]
        commands += [(('export-fmu', '--out'), 0), (('latency', '--duration', '0.05', '--rt', 'off', '--histogram'), 0)]
        for command, status in commands:
            for target in (device, link, pipe, self.folder):
                with self.subTest(command=command, target=target.name):
                    result = self.run_program(*command, target)
                    refused = target in (pipe, self.folder)
                    self.assertEqual(result.returncode, 2 if refused else status, result.stderr)
                    self.assertIn(str(target) if refused else '', result.stderr)
            self.assertTrue(device.is_char_device())
            self.assertTrue(link.is_symlink())
            self.assertTrue(pipe.is_fifo())
            self.assertGreater(real.stat().st_size, 0)
            real.unlink()
        self.assertEqual([path.name for path in self.folder.iterdir() if path.name.endswith('.part')], [])
        result = self.run_program('--fast', '--no-lcm', '--summary', '/dev/stdout')
        self.assertEqual(json.JSONDecoder().raw_decode(result.stdout)[0]['result'], 'completed')

    def test_a_result_named_with_a_dash_goes_to_stdout_alone(self):
        log = self.folder / 'run.lcmlog'
        brief = ('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=60')
        self.run_program(*brief, '--log', log)
        comparison = ('compare', '--controllers', 'pi', '--repeat', '1')
        for command in (*((*brief, option) for option in ('--csv', '--log', '--summary')), ('replay', log, '--csv'),
                        *((*comparison, option) for option in ('--json', '--csv', '--markdown', '--runs'))):
            with self.subTest(command):
                file = self.folder / 'file'
                whole = self.run_program(*command, file)
                for stdout in (subprocess.PIPE, open(self.folder / 'out', 'w+b')):
                    result = subprocess.run([PROGRAM, *map(str, command), '-'], stdout=stdout, stderr=subprocess.PIPE,
                                            cwd=self.folder, timeout=60)
                    self.assertEqual(result.returncode, 0, result.stderr)
                    said = result.stdout if stdout == subprocess.PIPE else (self.folder / 'out').read_bytes()
                    self.assertEqual(said, file.read_bytes())
                    self.assertIn(whole.stdout.strip(), result.stderr.decode())
        self.assertFalse((self.folder / '-').exists())
        result = self.run_program(*brief, '--csv', '-', '--summary', '-')
        self.assertEqual(result.returncode, 2)
        self.assertIn("summary '-': another result goes into the same file", result.stderr)

    def test_an_older_file_survives_a_run_that_is_refused(self):
        older = self.folder / 'older'
        for option in ('--csv', '--log', '--summary'):
            older.write_text('older')
            result = self.run_program('--backend', 'rig', '--no-lcm', option, older)
            self.assertEqual(result.returncode, 3, result.stderr)
            result = self.run_program('--fast', '--no-lcm', option, older, '--out', older)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertEqual(older.read_text(), 'older')
        self.assertEqual([path.name for path in self.folder.iterdir()], ['older'])

    def test_a_full_disk_behind_stdout_is_said(self):
        plant = self.folder / 'plant.toml'
        for command in (['--fast', '--no-lcm'], ['list'], ['list', '--keys'], ['doctor', '--json'], ['--help'], ['--version'],
                        ['validate', '--schema'], ['validate', 'paper'], ['study', '--help'],
                        ['compare', '--controllers', 'pi', '--repeat', '1'], ['export-fmu', '--out', self.folder / 'x.fmu'],
                        ['latency', '--duration', '0.05', '--rt', 'off', '--json'], ['init-rig', plant.stem]):
            with self.subTest(command), open('/dev/full', 'w') as full:
                result = subprocess.run([PROGRAM, *map(str, command)], stdout=full, stderr=subprocess.PIPE, text=True,
                                        timeout=60, cwd=self.folder)
                self.assertIn(result.returncode, (1, 3), result.stderr)
                self.assertRegex(result.stderr, 'No space left|cannot write to standard output')
        for program in 'abs_guardian', 'abs_rig_emulator':
            with open('/dev/full', 'w') as full:
                path = pathlib.Path(PROGRAM).with_name(program)
                self.assertEqual(subprocess.run([path, '--help'], stdout=full, stderr=subprocess.DEVNULL).returncode, 1)
        closed = subprocess.run(['sh', '-c', '"$0" list >&-', PROGRAM], stderr=subprocess.PIPE, text=True)
        self.assertEqual(closed.returncode, 1)
        self.assertIn('cannot write to standard output', closed.stderr)
        # A reader that wanted no more is no failure.
        with subprocess.Popen([PROGRAM, 'list'], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as reader:
            reader.stdout.close()
            self.assertEqual(reader.wait(), 0)

    def test_long_and_odd_names_are_clear_errors(self):
        long, nowhere = 'n' * 300, self.folder / 'nowhere' / 'file'
        for option in ('--csv', '--log', '--summary', '--out', '--config', '--plant', '--experiment', '--controller'):
            for name in (self.folder / long, self.folder / ('d/' * 3000 + 'x'), ''):
                with self.subTest(option=option, name=str(name)[:60]):
                    result = self.run_program('--fast', '--no-lcm', option, name)
                    self.assertEqual(result.returncode, 2, result.stderr[:400])
                    self.assertRegex(result.stderr, 'abs_hil: [^ ]')
                    self.assertNotIn('filesystem error', result.stderr)
        odd = os.fsencode(self.folder) + b'/\xff\xfe'
        for option in ('--csv', '--out', '--plant', '--recorder', '--lcm-url'):
            result = subprocess.run([PROGRAM, '--fast', option, odd], capture_output=True, timeout=60)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(b'argument 3', result.stderr)
        result = subprocess.run([PROGRAM, 'doctor', '--json'], capture_output=True, timeout=60,
                                env={**os.environb, b'LCM_DEFAULT_URL': b'udpm://\xff'})
        self.assertIn('findings', json.loads(result.stdout))
        for option in ('--csv', '--log', '--summary'):
            result = self.run_program('--fast', '--no-lcm', option, nowhere)
            self.assertEqual(result.returncode, 2)
            self.assertIn('mkdir -p', result.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_fault_status(self):
        summary = self.folder / 'summary.json'
        result = self.run_program('--fast', '--no-lcm', '--set', 'experiment.accelerate_limit_s=2', '--summary', summary)
        self.assertEqual(result.returncode, 1)
        self.assertIn('time limit', result.stderr)
        self.assertEqual(self.summary(summary)['result'], 'fault')
        self.assertIsNone(self.summary(summary)['stop_time_s'])

    def test_list(self):
        words = self.run_program('list').stdout
        for name in ('adaptive', 'nominal', 'paper-table1', 'paper-timing', 'paper', 'sim', 'rig'):
            self.assertIn(name, words)

    def test_each_key_is_listed_with_its_value_in_a_column_of_its_own(self):
        summary = self.folder / 'summary.json'
        self.fast('--set', 'experiment.start_speed_rad_s=170', '--summary', summary)

        def names(table, prefix=''):
            for name, value in table.items():
                yield from names(value, f'{prefix}{name}.') if isinstance(value, dict) else [prefix + name]

        config = self.summary(summary)['config']
        del config['experiment_script']  # the script's text is not a key
        lines = self.run_program('list', '--keys').stdout.splitlines()
        # A value of the model that nobody sets is the plant's, and not part of the configuration.
        keys = [line.split()[0] for line in lines]
        self.assertEqual(sorted(key for key in keys if not key.startswith(('model.', 'rig.'))), sorted(names(config)))
        listed = {line.split()[0]: line.split()[1] for line in lines}
        self.assertEqual(listed['control.sliding_mode_smooth.boundary_m_s'], '2.93')

    def test_quantities_are_listed_with_their_csv_columns(self):
        rows = json.loads(self.run_program('list', '--quantities', '--json').stdout)
        columns = sorted((row['csv_column'], row['name']) for row in rows if row['csv_column'])
        self.assertEqual(','.join(name for _, name in columns), HEADER)
        self.assertEqual([row['values'] for row in rows if row['name'] == 'phase'], [PHASES + ['fault']])
        lines = self.run_program('list', '--quantities').stdout.splitlines()
        self.assertEqual([line.split()[0] for line in lines[1:]], [row['name'] for row in rows])

    def test_reasons_are_listed_with_number_kind_and_text(self):
        rows = json.loads(self.run_program('list', '--reasons', '--json').stdout)
        overspeed = next(row for row in rows if row['number'] == 65)
        self.assertEqual(overspeed, {'number': 65, 'name': 'overspeed', 'kind': 'fault', 'found_again': 'yes',
                                     'text': 'wheel speed above the limit', 'quantity': 'speed', 'unit': 'rad/s',
                                     'bound': 'gate.overspeed_rad_s'})
        lines = self.run_program('list', '--reasons').stdout.splitlines()
        self.assertEqual([int(line.split()[0]) for line in lines[1:]], [row['number'] for row in rows])
        self.assertEqual(self.run_program('list', '--json').returncode, 2)

    def test_the_signals_of_each_controller_are_listed(self):
        section = self.run_program('list').stdout.split('signals (')[1].splitlines()[1:]
        names = dict(line.split(maxsplit=1) for line in section)
        for controller in ('adaptive', 'pi'):
            path = self.folder / f'{controller}.csv'
            self.fast('--controller', controller, '--csv', path)
            own = [names[controller]] if controller in names else []
            self.assertEqual(path.read_text().splitlines()[0].replace(',', ', '), ', '.join([HEADER.replace(',', ', '), *own]))
        self.assertIn('adaptive', names)

    def test_a_wrong_argument_points_to_the_help_of_its_command(self):
        for command, arguments in (('abs_hil', ['--bogus']), ('abs_hil list', ['list', '--bogus'])):
            result = self.run_program(*arguments)
            self.assertEqual(result.returncode, 2)
            self.assertIn(f'({command} --help shows all options)', result.stderr)

    def test_environment_names_the_configuration(self):
        (self.folder / 'plants').mkdir()
        (self.folder / 'plants' / 'mine.toml').write_text('description = "mine"\n[plant]\ntheta_N = 30\n')
        result = self.run_program('--fast', '--no-lcm', '--plant', 'mine', env={'ABS_HIL_CONFIG_DIR': str(self.folder)})
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_a_changing_road_is_in_the_record_and_the_configuration(self):
        csv, summary = self.folder / 'run.csv', self.folder / 'summary.json'
        self.fast('--experiment', 'friction-jump', '--set', 'experiment.start_speed_rad_s=170', '--csv', csv,
                  '--summary', summary)
        thetas = [round(float(row['theta_N'])) for row in self.rows(csv)]
        self.assertEqual(thetas[:600] + thetas[1000:], [23] * (len(thetas) - 400))
        self.assertEqual(thetas[600:1000], [12] * 400)
        self.assertIn('braking time', self.summary(summary)['config']['plant']['friction_profile'])
        self.fast('--experiment', 'friction-jump', '--set', 'plant.friction_profile=time: 0.5', '--csv', csv)
        self.assertEqual({row['theta_N'] for row in self.rows(csv)}, {'11.5'})


if __name__ == '__main__':
    unittest.main()
