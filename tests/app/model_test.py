"""What the controllers believe, model.*, apart from the simulated truth, plant.*; and runs that brake without a stop."""
import tomllib
import unittest

from program import ProgramTest

BRAKING = ('--set', 'experiment.start_speed_rad_s=170')


class Model(ProgramTest):
    def summary_of(self, *args):
        path = self.folder / 'summary.json'
        result = self.fast(*BRAKING, '--summary', path, *args)
        return self.summary(path), result.stdout

    def test_model_and_plant_part(self):
        for sets in (('model.theta_N=23', 'plant.theta_N=40'), ('plant.theta_N=40', 'model.theta_N=23')):
            summary, text = self.summary_of(*(word for s in sets for word in ('--set', s)))
            self.assertAlmostEqual(summary['theta_final_N'] / 40, 1, delta=0.03)
            self.assertEqual(summary['model_differences'], {'theta_N': {'model': 23.0, 'plant': 40.0}})
            self.assertIn('differs from plant: theta_N 23 (plant 40)', text)
            self.assertEqual(summary['config']['model'], {'theta_N': 23.0})

    def test_the_model_follows_the_plant(self):
        summary, text = self.summary_of('--set', 'plant.theta_N=40')
        self.assertEqual(summary['model_differences'], {})
        self.assertNotIn('model', summary['config'])
        self.assertNotIn('differs from plant', text)
        self.assertIn('at 3 m/s', text)

    def test_a_wrong_model_changes_the_run_and_the_distance_stays_the_plants(self):
        right, _ = self.summary_of()
        wrong, _ = self.summary_of('--set', 'model.J1_kg_m2=0.00905')
        self.assertNotEqual(right['slip_rms'], wrong['slip_rms'])
        csv = self.folder / 'run.csv'
        self.fast(*BRAKING, '--set', 'model.r2_m=0.101', '--csv', csv)
        rows = self.rows(csv)
        braking = [row for row in rows if row['phase'] in ('brake', 'hold')]
        travelled = sum((float(a['omega2_rad_s']) + float(b['omega2_rad_s'])) / 2 * 0.099 *
                        (float(b['time_s']) - float(a['time_s'])) for a, b in zip(braking, braking[1:]))
        self.assertAlmostEqual(float(braking[-1]['distance_m']), travelled, places=3)

    def test_what_a_braking_has_learnt_begins_the_next_one(self):
        prior = self.folder / 'prior.toml'
        law = ('--controller', 'adaptive-optimal', '--set', 'plant.B=9')
        first, _ = self.summary_of(*law, '--prior', prior)
        key = 'control.adaptive_optimal.last_peak_slip'
        self.assertEqual(first['config']['control']['adaptive_optimal']['last_peak_slip'], 0.0)
        second, _ = self.summary_of(*law, '--prior', prior)
        self.assertEqual(second['config']['control']['adaptive_optimal']['last_peak_slip'], first['learnt'][key])
        self.assertLess(second['stop_distance_m'], first['stop_distance_m'])
        # It is renewed by a stop only, and a law that learns nothing leaves it alone.
        renewed = prior.read_text()
        self.assertIn(f'{key} = {second["learnt"][key]}', renewed)
        self.run_program('--fast', '--no-lcm', *law, '--prior', prior, '--inject', 'brake@encoder_upper:stuck+0.1s')
        self.assertNotIn('learnt', self.summary_of('--prior', prior)[0])
        self.assertEqual(prior.read_text(), renewed)
        # Options rank above it.
        third, _ = self.summary_of(*law, '--prior', prior, '--set', key + '=0')
        self.assertEqual(third['stop_distance_m'], first['stop_distance_m'])

    def test_bad_priors(self):
        prior = self.folder / 'prior.toml'
        self.fast(*BRAKING, '--controller', 'adaptive-optimal', '--prior', prior)
        good = prior.read_text()

        def refused(text, *words, args=()):
            prior.write_text(text)
            result = self.run_program('--fast', '--no-lcm', '--prior', prior, *args)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in (str(prior), *words):
                self.assertIn(word, result.stderr)
        refused(good, 'another model than paper-timing', args=('--plant', 'paper-timing'))
        refused(good.replace('format = 1', 'format = 2'), 'not of format 1')
        refused('', 'prior.format', 'remove it')
        refused(good + 'plant.B = 3\n', 'plant.B')
        refused(good.replace('slip = 0', 'slip = 1'), 'last_peak_slip', '[0, 1)')
        refused(good, 'series', args=('--experiment', 'series-of-ten'))

    def test_whole_models(self):
        summary, _ = self.summary_of('--model', 'paper-timing')
        self.assertEqual((summary['plant'], summary['model']), ('paper-table1', 'paper-timing'))
        self.assertEqual(len(summary['config']['model']), 29)
        self.assertIn('theta_N', summary['model_differences'])
        mine = self.folder / 'mine.toml'
        mine.write_text('[plant]\ntheta_N = 30\n[model]\nJ1_kg_m2 = 0.008\n')
        summary, _ = self.summary_of('--plant', mine)
        self.assertEqual(list(summary['model_differences']), ['J1_kg_m2'])
        summary, _ = self.summary_of('--model', mine)
        self.assertEqual(list(summary['model_differences']), ['theta_N', 'J1_kg_m2'])
        result = self.run_program('--fast', '--no-lcm', '--model', 'paper-table9')
        self.assertEqual(result.returncode, 2)
        self.assertIn('--model: unknown plant "paper-table9"', result.stderr)

    def test_a_run_folder_gives_the_same_run_and_keeps_the_difference(self):
        first, second = self.folder / 'first', self.folder / 'second'
        self.fast(*BRAKING, '--set', 'model.c31_per_s=16', '--set', 'plant.theta_N=30', '--out', first)
        self.assertEqual(tomllib.loads((first / 'config.toml').read_text())['model'], {'c31_per_s': 16})
        self.fast('--config', first / 'config.toml', '--out', second)
        for name in ('config.toml', 'run.csv', 'run.lcmlog'):
            self.assertEqual((first / name).read_bytes(), (second / name).read_bytes(), name)
        self.assertEqual(self.run_program('replay', first / 'run.lcmlog', '--check').returncode, 0)

    def test_compare_varies_the_plant_only(self):
        def means(*args):
            path = self.folder / 'table.json'
            result = self.run_program('compare', '--controllers', 'adaptive', '--repeat', 2, '--json', path, *args)
            self.assertEqual(result.returncode, 0, result.stderr)
            return self.summary(path)['controllers'][0]['metrics']['slip_rms']['mean'], result.stdout
        right, text = means()
        self.assertNotIn('model differs', text)
        wrong, text = means('--set', 'model.c31_per_s=16')
        self.assertNotEqual(right, wrong)
        self.assertIn('The model differs from the plant: c31_per_s 16 (plant 20.37)', text)
        self.assertEqual(means('--model', 'paper-table1')[0], right)

    def test_a_theta_that_the_estimate_cannot_reach_is_a_warning(self):
        result = self.fast(*BRAKING, '--set', 'plant.theta_N=130')
        self.assertIn('plant.theta_N = 130', result.stderr)
        self.assertIn('control.adaptive.theta_max_N', result.stderr)
        self.assertNotIn('theta_max_N', self.fast(*BRAKING, '--set', 'plant.theta_N=40').stderr)


class OnTheRig(ProgramTest):
    """Without a board: what a run is told comes before the search for one, which ends with status 3."""

    def rig(self, *args):
        return self.run_program('--backend', 'rig', '--no-lcm', *args)

    def test_values_of_the_plant_are_refused(self):
        for key, words in (('plant.theta_N=30', ['plant.theta_N', 'model.theta_N']),
                           ('plant.tyre=inteco-mu', ['plant.tyre', '--backend sim'])):
            result = self.rig('--set', key)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)
        self.assertEqual(self.rig('--set', 'model.theta_N=30').returncode, 3)

    def test_a_rig_has_a_model_and_no_plant(self):
        config = self.folder / 'config.toml'
        config.write_text('[plant]\nb1_Nm = 5\n')
        for args, words in ((('--config', config), (f'{config}:2: plant.b1_Nm: a rig has no', 'set model.b1_Nm')),
                            (('--plant', 'paper-timing'), ('--plant paper-timing: a rig has no', '--model paper-timing'))):
            result = self.rig(*args)
            self.assertEqual(result.returncode, 2, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)
        config.write_text('[model]\nb1_Nm = 5\n')
        for args in ((), ('--model', 'paper-timing')):
            self.assertNotIn('simulated plant', self.rig(*args).stderr)
        strong = self.folder / 'strong.toml'
        strong.write_text('[[phase]]\nname = "a"\nbrake = { torque_Nm = 2 }\nuntil = { lasts_s = 1 }\n')
        for args, status in (((), 0), (('--config', config), 2)):
            self.assertEqual(self.run_program('validate', strong, '--backend', 'rig', *args).returncode, status)
        text = self.run_program('validate', 'paper', '--backend', 'rig', '--model', 'paper-timing').stdout
        self.assertIn('backend rig, model paper-timing', text)


class WithoutAStop(ProgramTest):
    COARSE = ('--set', 'plant.encoder_counts_per_rev=100', '--set', 'control.observer.standstill_time_s=0.005')

    def test_a_car_that_still_moves_has_not_completed(self):
        path = self.folder / 'summary.json'
        result = self.run_program('--fast', '--no-lcm', *BRAKING, *self.COARSE, '--summary', path)
        summary = self.summary(path)
        self.assertIsNone(summary['stop_time_s'])
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertNotEqual(summary['result'], 'completed')
        self.assertIn('experiment.end_speed_m_s', summary['reason'])
        self.assertIn('still moved', summary['missing']['stop_time_s'])
        self.assertIn('still moved', result.stdout)
        # A rig does not know the true speed: there the configuration is the warning.
        self.assertIn('control.observer.standstill_time_s = 0.005', result.stderr)
        self.assertIn('every 0.0207 s', result.stderr)
        self.assertNotIn('standstill_time_s', self.fast(*BRAKING).stderr)

    def test_an_experiment_that_means_no_stop_completes(self):
        short = self.folder / 'short.toml'
        short.write_text('[[phase]]\nname = "brake"\nbrake = "controller"\nuntil = { lasts_s = 0.5 }\n')
        path = self.folder / 'summary.json'
        self.fast(*BRAKING, '--experiment', short, '--summary', path)
        self.assertIsNone(self.summary(path)['stop_time_s'])
        self.fast('--experiment', 'coast-down', '--summary', path)
        self.assertEqual(self.summary(path)['missing']['stop_time_s'], 'the run did not brake')

    def test_the_end_speed_is_found_in_whatever_phase_it_is_crossed(self):
        last = self.folder / 'last.toml'
        last.write_text('[[phase]]\nname = "brake"\nbrake = "controller"\n'
                        'until = { car_speed_below_m_s = "$experiment.end_speed_m_s" }\nat_most_s = 9\n')
        path = self.folder / 'summary.json'
        for seed in range(1, 11):
            for experiment in ('paper', last):
                self.fast(*BRAKING, '--experiment', experiment, '--seed', seed, '--set', 'control.v_min_m_s=0.3',
                          '--set', 'experiment.end_speed_m_s=0.3', '--summary', path)
                self.assertIsNotNone(self.summary(path)['stop_time_s'], (seed, experiment))


if __name__ == '__main__':
    unittest.main()
