"""Bad input: status 2 (3 for a missing resource), one clear line on stderr, and no files written."""
import unittest

from program import ProgramTest


class BadInput(ProgramTest):
    def refused(self, args, words, status=2):
        with self.subTest(args=args):
            csv = self.folder / 'run.csv'
            summary = self.folder / 'summary.json'
            result = self.run_program('--fast', '--no-lcm', '--csv', csv, '--summary', summary, *args)
            self.assertEqual(result.returncode, status, result.stderr)
            lines = result.stderr.strip().splitlines()
            self.assertEqual(len(lines), 1, result.stderr)
            for word in words:
                self.assertIn(word, lines[0])
            self.assertFalse(summary.exists())
            self.assertFalse(csv.exists(), 'a refused run must not touch files')
        return result

    def test_no_argument_at_all(self):
        """It says what to type, and starts nothing."""
        result = self.run_program(cwd=self.folder)
        self.assertEqual(result.returncode, 2)
        for words in ('abs_hil --fast --no-lcm --out runs/a', 'abs_hil report runs/a', 'abs_hil --backend sim', 'abs_hil --help'):
            self.assertIn(words, result.stderr)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_usb_board(self):
        usb = ['--backend', 'rig', '--set', 'driver.kind=usb', '--set', 'driver.emulated=true']
        none = ['--set', f'driver.usb.sysfs_root={self.folder}']
        self.refused([*usb, *none], ['no RT-DAC/USB2 board', 'driver.usb.manufacturer="InTeCo"'], status=3)
        self.refused([*usb, '--set', 'driver.usb.enable_line=15'], ['driver.usb.enable_line', '[-1, 14]'])
        self.refused([*usb, '--set', 'driver.usb.drive_pwm=1'], ['driver.usb.drive_pwm = driver.usb.brake_pwm = 1'])
        late = self.run_program('--backend', 'rig', '--no-lcm', '--set', 'driver.kind=usb', '--rate', '2000')
        self.assertEqual(late.returncode, 2, late.stderr)
        self.assertIn('a cycle must not wait longer than its period; give a value below 500', late.stderr)

    def test_configuration_values(self):
        self.refused(['--set', 'plant.thetaN=3'], ['plant.thetaN', 'plant.theta_N'])
        self.refused(['--set', 'plant.theta_N=-5'], ['plant.theta_N', '-5', '(0, 100000]', 'N'])
        self.refused(['--set', 'plant.theta_N=nan'], ['plant.theta_N', 'nan'])
        self.refused(['--set', 'plant.theta_N=abc'], ['plant.theta_N', 'abc'])
        self.refused(['--set', 'control.rate_Hz=0'], ['control.rate_Hz', '[100, 10000]'])
        self.refused(['--set', 'control.adaptive.ks1=inf'], ['control.adaptive.ks1'])
        self.refused(['--set', 'plant.theta_N'], ['key=value'])
        self.refused(['--slip-ref', '1.5'], ['--slip-ref', '1.5', '(0, 1)'])
        self.refused(['--rate', '50'], ['--rate', '50'])
        self.refused(['--seed', '-1'], ['--seed'])

    def test_values_that_do_not_go_together(self):
        self.refused(['--set', 'control.adaptive.theta_min_N=60', '--set', 'control.adaptive.theta_max_N=50'],
                     ['theta_min_N', 'theta_max_N'])

    def test_road(self):
        self.refused(['--set', 'plant.friction_profile=time: 1; 0.5 at soon'],
                     ['plant.friction_profile', '0.5 at soon', 'number'])
        self.refused(['--set', 'plant.tyre=pacejka'], ['plant.tyre', 'pacejka', 'magic-formula', 'inteco-mu'])
        self.refused(['--plant', 'inteco-manual', '--set', 'plant.friction_profile=time: 9'], ['plant.load', 'wedge'])

    def test_names(self):
        self.refused(['--controller', 'nope'], ['nope', 'adaptive'])
        self.refused(['--plant', 'paper-table9'], ['paper-table9', 'paper-table1'])
        self.refused(['--experiment', 'parade'], ['parade', 'paper'])
        self.refused(['--backend', 'moon'], ['moon', 'sim'])
        self.refused(['--bogus'], ['--bogus'])
        self.refused(['--rt', 'perhaps'], ['perhaps'])
        self.refused(['--set', 'control.slip_ref', '=', '0.1'], ['unexpected word =', 'without spaces'])

    def test_files(self):
        self.refused(['--plant', '/nonexistent.toml'], ['/nonexistent.toml'])
        self.refused(['--config', '/nonexistent.toml'], ['/nonexistent.toml'])
        bad = self.folder / 'bad.toml'
        bad.write_text('[plant]\nx=')
        self.refused(['--config', bad], ['bad.toml:2'])
        bad.write_text('[plant]\ntheta_N = 30\n\n[control]\nslipref = 0.1\n')
        self.refused(['--config', bad], ['bad.toml:5', 'control.slip_ref'])

    def test_output_paths(self):
        for option in ('--csv', '--log', '--summary'):
            result = self.run_program('--fast', '--no-lcm', option, '/nonexistent/dir/file')
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn('/nonexistent/dir/file', result.stderr)

    def test_names_that_promise_another_format(self):
        for option, name, right in (('--csv', 'a.parquet', 'FILE.csv'), ('--csv', 'a.json', 'FILE.csv'),
                                    ('--log', 'a.csv', 'FILE.lcmlog'), ('--summary', 'a.csv', 'FILE.json'),
                                    ('--out', 'a.csv', 'DIR'), ('--out', 'a.html', 'DIR')):
            with self.subTest(option=option, name=name):
                self.refused([option, self.folder / name], [option, name, f'give {right}'])
        for args in (['compare', '--repeat', 1, '--out', 'a.pdf'], ['compare', '--repeat', 1, '--runs', 'a.json'],
                     ['replay', 'a', '--out', 'a.mcap'], ['study', 'a.toml', '--out', 'a.parquet']):
            with self.subTest(args=args):
                result = self.run_program(*args, cwd=self.folder)
                self.assertEqual((result.returncode, result.stderr.count('\n')), (2, 1), result.stderr)
                self.assertIn('give ', result.stderr)

    def test_results_that_would_replace_an_input_or_each_other(self):
        log, config, run = self.folder / 'run.lcmlog', self.folder / 'own', self.folder / 'run'
        config.write_text('[control]\nslip_ref = 0.1\n')
        self.fast('--log', log, '--out', run)
        kept = {path: path.read_bytes() for path in (log, config, run / 'run.csv')}
        both = self.folder / 'both'
        for args, words in ((['--fast', '--no-lcm', '--config', config, '--csv', config], 'this command reads it'),
                            (['--fast', '--no-lcm', '--csv', both, '--log', both], 'another result goes into the same file'),
                            (['replay', log, '--csv', log], 'give FILE.csv'),
                            (['replay', run, '--csv', run / 'run.csv'], 'this command reads it')):
            result = self.run_program(*args)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(words, result.stderr)
        self.assertFalse(both.exists())
        for path, content in kept.items():
            self.assertEqual(path.read_bytes(), content)

    def test_texts_that_no_terminal_should_get(self):
        bad = self.folder / 'bad.toml'
        bad.write_text('[control]\ncontroller = "pi\\u0000\\u001b[31m"\n')
        result = self.refused(['--config', bad], ['pi\ufffd\ufffd[31m', 'give one of adaptive'])
        self.assertNotIn('\x1b', result.stderr)
        bad.write_text('a' * 100_000 + ' = 1\n')
        self.refused(['--config', bad], ['unknown key aaa'])

    def test_lcm_url(self):
        result = self.run_program('--fast', '--lcm-url', 'nonsense')
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('nonsense', result.stderr)

    def test_rig_without_a_board(self):
        result = self.run_program('--backend', 'rig', '--no-lcm')
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn('driver.kind', result.stderr)

    def test_a_run_that_cannot_start_leaves_earlier_files_whole(self):
        empty = self.folder / 'no-cards'
        empty.mkdir()
        earlier = {option: self.folder / f'earlier{option}' for option in ('--csv', '--log', '--summary')}
        for path in earlier.values():
            path.write_text('of an earlier run')
        outputs = [word for option, path in earlier.items() for word in (option, path)]
        result = self.run_program('--backend', 'rig', '--no-lcm', '--set', f'driver.pci.root={empty}', *outputs)
        self.assertEqual(result.returncode, 3, result.stderr)
        for path in earlier.values():
            self.assertEqual(path.read_text(), 'of an earlier run')

    def test_injected_faults(self):
        self.refused(['--inject', 'brake@wheel:stuck'], ['wheel', 'encoder_upper', 'brake@encoder_upper:stuck+0.2s'])
        self.refused(['--inject', 'brake@read:bent'], ['bent', 'intermittent'])
        self.refused(['--set', 'run.inject=sleep@read:off'], ['sleep', 'accelerate'])

    def test_no_faults_into_hardware(self):
        fault = ['--inject', 'brake@encoder_upper:stuck+0.2s']
        for args, words in ((fault, ['driver.emulated=true', 'never']),
                            (['--set', 'run.inject=hold@write:off'], ['hold@write:off', 'never']),
                            ([*fault, '--set', 'driver.emulated=true'], ['/sys/bus/pci/devices', 'real cards']),
                            ([*fault, '--set', 'driver.emulated=true', '--set', 'driver.pci.root=/proc/../sys/bus'],
                             ['real cards'])):
            result = self.run_program('--backend', 'rig', '--no-lcm', *args)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)

    def test_caps_above_the_rigs(self):
        for args, words in ((['--set', 'gate.brake_duty_max=0.9'], ['gate.brake_duty_max', '0.9', '0.7', 'driver.pci']),
                            (['--set', 'gate.motor_duty_max=0.8', '--set', 'driver.pci.motor_duty_max=0.6'],
                             ['gate.motor_duty_max', '0.8', '0.6'])):
            result = self.run_program('--backend', 'rig', '--no-lcm', *args)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)

    def test_no_run_without_an_end(self):
        for key in ('accelerate_limit_s', 'brake_limit_s', 'hold_limit_s', 'idle_s', 'coast_s', 'stopped_s'):
            self.refused(['--set', f'experiment.{key}=inf'], [f'experiment.{key}', 'inf'])

    def test_what_only_the_simulator_can_do(self):
        for args, words in ((['--fast'], ['--fast']),
                            (['--set', 'experiment.start_speed_rad_s=100'], ['experiment.start_speed_rad_s']),
                            (['--experiment', 'friction-jump'], ['friction-jump.toml:4:1', '[[event]] friction',
                                                                 'friction-jump with --backend sim']),
                            (['--set', 'plant.friction_profile=time: 0.5'], ['plant.friction_profile']),
                            (['--set', 'plant.brake_torque_profile=time: 0.5'], ['plant.brake_torque_profile'])):
            result = self.run_program('--backend', 'rig', '--no-lcm', *args)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)

    def test_events_of_a_script_of_ones_own_on_the_rig(self):
        phase = '[[phase]]\nname = "brake"\nbrake = "controller"\nuntil = { lasts_s = 1 }\n'
        for event in ('friction = 0.5', 'brake_torque = 0.5', 'motor_torque = 0.5', 'upper_bearing = 2',
                      'lower_bearing = 2'):
            script = self.folder / 'mine.toml'
            script.write_text(f'{phase}[[event]]\nat_s = 0.2\nuntil_s = 0.5\n{event}\n')
            result = self.run_program('--backend', 'rig', '--no-lcm', '--experiment', script)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(f'mine.toml:5:1: [[event]] {event.split()[0]}: only a simulated plant', result.stderr)
        script.write_text(f'{phase}[[event]]\ninject = "brake@write:off+0.2s"\n')
        result = self.run_program('--backend', 'rig', '--no-lcm', '--experiment', script)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('mine.toml:5:1: [[event]] inject: faults are never injected into real hardware', result.stderr)


if __name__ == '__main__':
    unittest.main()
