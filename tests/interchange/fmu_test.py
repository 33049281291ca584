"""Exported FMUs in FMPy: valid, equal to abs_hil --fast, the same in both versions of FMI. usage: see foreign.py"""
import pathlib
import platform
import subprocess
import sys
import unittest
import zipfile

from foreign import SOURCE  # first: it reads the arguments

from program import PROGRAM, ProgramTest

try:
    import fmpy
    import fmpy.validation
    from fmpy.fmi1 import FMICallException
    from fmu_loop import Instance, stop
except ImportError as error:
    print(f'SKIPPED: {error}: scripts/setup_python.sh')
    sys.exit(77)

START = ['--set', 'experiment.start_speed_rad_s=170']
IDEAL = ['--set', 'plant.ideal_sensors=true', '--set', 'plant.ideal_actuator=true']


class FmuTest(ProgramTest):
    def export(self, name, *options, fmi=2):
        path = self.folder / f'{name}{fmi}.fmu'
        result = self.run_program('export-fmu', '--fmi', fmi, '--out', path, '--force', *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return str(path)

    def pair(self, fmi, *options, controller='adaptive'):
        plant = Instance(self.export('plant', *START, *options, fmi=fmi))
        law = Instance(self.export('law', '--controller', controller, *START, *options, fmi=fmi))
        self.addCleanup(plant.close)
        self.addCleanup(law.close)
        return plant, law

    def fast_stop(self, *options):
        summary = self.folder / 'summary.json'
        self.fast(*START, '--summary', summary, *options)
        return self.summary(summary)

    def test_fmpy_validates_them(self):
        for fmi in (2, 3):
            for name, options in (('plant', ()), ('law', ('--controller', 'adaptive')), ('road', ('--plant', 'inteco-manual'))):
                with self.subTest(name=name, fmi=fmi):
                    path = self.export(name, *options, fmi=fmi)
                    self.assertEqual(fmpy.validation.validate_fmu(path), [])
                    names = zipfile.ZipFile(path).namelist()
                    self.assertIn('binaries/linux64/abs_hil_fmu.so' if fmi == 2 else 'binaries/x86_64-linux/abs_hil_fmu.so', names)
                    result = fmpy.simulate_fmu(path, stop_time=0.1, output_interval=1e-3)
                    self.assertEqual(len(result), 101)

    def test_parameters_come_from_the_rows(self):
        for fmi in (2, 3):
            for name, options in (('law', ('--controller', 'adaptive-optimal')), ('plant', ('--set', 'plant.theta_N=30'))):
                description = fmpy.read_model_description(self.export(name, *options, fmi=fmi))
                self.assertEqual((description.license, description.author), ('BSD-3-Clause', 'The abs_hil authors'))
                # FMI has whole exponents alone.
                without = {unit.name for unit in description.unitDefinitions if unit.baseUnit is None}
                self.assertLessEqual(without, {'m^0.5/s^1.5'})
            variables = {v.name: v for v in description.modelVariables}
            theta = variables['plant.theta_N']
            self.assertEqual((float(theta.start), theta.unit, float(theta.max)), (30.0, 'N', 100000.0))
            self.assertTrue(theta.description)
            self.assertEqual(variables['upper_counts'].causality, 'output')
            self.assertEqual(variables['brake_duty'].causality, 'input')
            keys = self.run_program('list', '--keys').stdout
            for name in variables:
                if name.startswith('plant.'):
                    self.assertIn(name + ' ', keys)

    def test_closed_loop_stops_as_the_program_does(self):
        for options, controller, bound in (((), 'adaptive', 0.005), (IDEAL, 'adaptive', 0.001), ((), 'pi', 0.005),
                                           ((), 'sliding-mode-smooth', 0.005)):
            expected = self.fast_stop('--controller', controller, *options)
            runs = []
            for fmi in (2, 3):
                with self.subTest(options=options, controller=controller, fmi=fmi):
                    pair = self.pair(fmi, *options, controller=controller)
                    time_s, distance_m, speeds = stop(*pair, ideal_sensors=bool(options))
                    print(f'{controller} {"ideal" if options else "real"} FMI {fmi}: {distance_m:.5f} m, abs_hil --fast '
                          f'{expected["stop_distance_m"]:.5f} m')
                    self.assertAlmostEqual(distance_m / expected['stop_distance_m'], 1.0, delta=bound)
                    self.assertAlmostEqual(time_s / expected['stop_time_s'], 1.0, delta=bound)
                    runs.append(speeds)
            self.assertEqual(*runs)

    def test_long_steps_are_the_control_period(self):
        """FMPy makes its own steps of 4 ms for three seconds. The loop then stops as the program does at 250 Hz."""
        for fmi in (2, 3):
            with self.subTest(fmi=fmi):
                path = self.export('law', '--controller', 'adaptive', fmi=fmi)
                self.assertGreater(len(fmpy.simulate_fmu(path, stop_time=3.0)), 700)
                expected = self.fast_stop('--controller', 'adaptive', '--rate', '250')
                time_s, distance_m, _ = stop(*self.pair(fmi), ideal_sensors=False, step_s=4e-3)
                print(f'FMI {fmi}, steps of 4 ms: {distance_m:.4f} m; abs_hil at 250 Hz {expected["stop_distance_m"]:.4f} m')
                self.assertAlmostEqual(distance_m / expected['stop_distance_m'], 1.0, delta=0.01)
                self.assertAlmostEqual(time_s / expected['stop_time_s'], 1.0, delta=0.01)

    def test_state_is_kept_set_and_serialised(self):
        for fmi in (2, 3):
            plant, law = self.pair(fmi)
            _, whole, speeds = stop(plant, law, ideal_sensors=False, end_speed_m_s=10)
            steps = len(speeds) - 1
            for instance in (plant, law):
                get, put, size, free = (('getFMUstate', 'setFMUstate', 'serializeFMUstate', 'freeFMUstate') if fmi == 2 else
                                        ('getFMUState', 'setFMUState', 'serializeFMUState', 'freeFMUState'))
                state = getattr(instance.fmu, get)()
                data = getattr(instance.fmu, size)(state)
                back = getattr(instance.fmu, size.replace('serialize', 'deSerialize' if fmi == 2 else 'deserialize'))(data)
                outputs = [v.name for v in instance.description.modelVariables if v.causality == 'output']
                before = [instance.get(name) for name in outputs]

                def go_on(instance=instance, outputs=outputs, n=steps):
                    for k in range(20):
                        instance.step((n + k) * 1e-3, 1e-3)
                    return [instance.get(name) for name in outputs]

                after = go_on()
                self.assertNotEqual(before, after)
                for kept in (state, back):
                    getattr(instance.fmu, put)(kept)
                    self.assertEqual([instance.get(name) for name in outputs], before)
                    self.assertEqual(go_on(), after)

    def test_a_kept_state_goes_on_as_all_steps_again_do(self):
        """In a new instance, for every law: the bytes of a state give the bits that a run from the start gives."""
        flaws = (*START, '--set', 'plant.brake_dead_time_s=0.004', '--set', 'plant.brake_hysteresis=0.05')
        plant_path = self.export('plant', *flaws)
        rows = self.run_program('list').stdout.partition('\nplants')[0].splitlines()[1:]
        for law in [row.split()[0] for row in rows]:
            path = self.export('law', *START, '--controller', law)

            def step(pair, n):
                plant, controller = pair
                for name in ('upper_counts', 'lower_counts'):
                    controller.set(name, plant.get(name))
                controller.step(n * 1e-3, 1e-3)
                plant.set('brake_duty', controller.get('brake_duty'))
                plant.step(n * 1e-3, 1e-3)
                return [one.get(v.name) for one in pair for v in one.description.modelVariables if v.causality == 'output']

            whole = Instance(plant_path), Instance(path)
            for n in range(150):
                step(whole, n)
            kept = [one.fmu.serializeFMUstate(one.fmu.getFMUstate()) for one in whole]
            expected = [step(whole, n) for n in range(150, 300)]
            later = [one.fmu.serializeFMUstate(one.fmu.getFMUstate()) for one in whole]
            for before, after in zip(kept, later):  # inputs are in it as texts
                self.assertAlmostEqual(len(before), len(after), delta=100, msg='the state does not grow with the steps')
            branch = Instance(plant_path), Instance(path)
            for one, data in zip(branch, kept):
                one.fmu.setFMUstate(one.fmu.deSerializeFMUstate(data))
            self.assertEqual([step(branch, n) for n in range(150, 300)], expected, law)
            damaged = bytearray(kept[1])
            damaged[len(damaged) // 2] ^= 1
            with self.assertRaises(FMICallException):
                branch[1].fmu.deSerializeFMUstate(bytes(damaged))
            for one in (*whole, *branch):
                one.close()

    def test_road_friction_is_the_plants_friction_profile(self):
        for fmi in (2, 3):
            path = self.export('plant', *START, fmi=fmi)
            by_profile = Instance(self.export('road', *START, '--set', 'plant.friction_profile=time: 1; 0.4 at 0.1', fmi=fmi))
            by_input, even = Instance(path), Instance(path)
            rows = []
            for n in range(200):
                by_input.set('road_friction', 0.4 if n >= 100 else 1.0)
                row = []
                for instance in (by_profile, by_input, even):
                    instance.set('brake_duty', 0.6)
                    instance.step(n * 1e-3, 1e-3)
                    row.append([instance.get(name) for name in ('omega1_rad_s', 'omega2_rad_s', 'theta_N')])
                rows.append(row)
            for n, (profile, given, _) in enumerate(rows):  # the profile's jump is within rounding of a step's end
                for expected, found in zip(profile[:2] if n == 99 else profile, given):
                    self.assertAlmostEqual(expected, found, delta=1e-9, msg=n)
            self.assertEqual([row[1] for row in rows[:100]], [row[2] for row in rows[:100]])
            self.assertNotEqual(rows[-1][1], rows[-1][2])
            icy = Instance(path, road_friction=0.4)
            self.assertAlmostEqual(icy.get('theta_N'), 0.4 * even.get('theta_N'), msg='before the first step, too')
            icy.close()
            with self.assertRaises(FMICallException):
                by_input.set('road_friction', 1.5)
                by_input.step(0.2, 1e-3)
            for instance in (by_profile, by_input, even):
                instance.close()

    def braking(self, pair, first, last, tune=()):
        """Torques asked for and slips of steps first to last - 1; `tune` is set before the first."""
        plant, law = pair
        for name, value in tune:
            law.set(name, value)
        torques, slips = [], []
        for n in range(first, last):
            for name in ('upper_counts', 'lower_counts'):
                law.set(name, plant.get(name))
            law.step(n * 1e-3, 1e-3)
            plant.set('brake_duty', law.get('brake_duty'))
            plant.step(n * 1e-3, 1e-3)
            torques.append(law.get('brake_torque_ref_Nm'))
            slips.append(law.get('slip_est'))
        return torques, slips

    def test_gains_are_tuned_between_steps(self):
        tuned = (('control.adaptive.ks1', 30.0), ('control.slip_ref', 0.3))
        for fmi in (2, 3):
            with self.subTest(fmi=fmi):
                described = {v.name: v.variability for v in fmpy.read_model_description(
                    self.export('law', '--controller', 'adaptive', fmi=fmi)).modelVariables}
                self.assertEqual({name for name, kind in described.items() if kind == 'tunable' and '.adaptive.' not in name},
                                 {'control.slip_ref'})
                self.assertEqual(described['control.adaptive.ks0'], 'tunable')
                self.assertEqual(described['control.adaptive.zeta0'], 'fixed', 'a start value')
                # Before the first step: as if exported so.
                exported = self.pair(fmi, *(word for name, value in tuned for word in ('--set', f'{name}={value}')))
                self.assertEqual(self.braking(self.pair(fmi), 0, 50, tuned), self.braking(exported, 0, 50))
                # Later: without a jump, and the slip goes to its new reference.
                pair, same = self.pair(fmi), self.pair(fmi)
                before, slips = self.braking(pair, 0, 300)
                self.assertEqual((before, slips), self.braking(same, 0, 300))
                after, slips = self.braking(pair, 300, 700, tuned)
                untouched, kept = self.braking(same, 300, 700)
                self.assertAlmostEqual(after[0], untouched[0], delta=0.05 * max(before))
                self.assertAlmostEqual(sum(kept[-100:]) / 100, 0.15, delta=0.03)
                self.assertAlmostEqual(sum(slips[-100:]) / 100, 0.3, delta=0.03)
                law = pair[1]
                for name, value in (('control.rate_Hz', 500.0), ('control.pi.kp_per_s', 1.0), ('control.adaptive.zeta0', 1.0)):
                    with self.assertRaises(FMICallException, msg=name):
                        law.set(name, value)

    def test_a_kept_state_knows_what_waits_to_be_tuned(self):
        pair = self.pair(2)
        self.braking(pair, 0, 200)
        for name, value in (('control.adaptive.ks1', 30.0), ('control.slip_ref', 0.3)):
            pair[1].set(name, value)
        self.braking(pair, 200, 201)  # the gains act now, the reference one step later
        kept = [one.fmu.getFMUstate() for one in pair]
        expected = self.braking(pair, 201, 300)
        for one, state in zip(pair, kept):
            one.fmu.setFMUstate(state)
        self.assertEqual(self.braking(pair, 201, 300), expected)

    def test_several_instances(self):
        path = self.export('plant', *START)
        instances = [Instance(path, f'rig {n}', plant__theta_N=15.0 + n) for n in range(3)]
        for n in range(50):
            for instance in instances:
                instance.set('brake_duty', 0.6)
                instance.step(n * 1e-3, 1e-3)
        speeds = [instance.get('omega2_rad_s') for instance in instances]
        self.assertEqual(len(set(speeds)), 3)
        for instance in instances:
            instance.close()

    def test_errors_go_to_the_log(self):
        for fmi in (2, 3):
            plant, law = self.pair(fmi)
            for action in (lambda plant=plant: plant.set('brake_duty', 1.5),
                           lambda plant=plant: plant.set('brake_duty', float('nan')),
                           lambda plant=plant: plant.set('plant.theta_N', 20.0), lambda plant=plant: plant.set('slip', 0.1),
                           lambda plant=plant: plant.step(5.0, 1e-3), lambda plant=plant: plant.step(0.0, -1.0),
                           lambda law=law: law.step(0.0, 0.5e-3), lambda law=law: law.step(0.0, 25e-3)):
                with self.assertRaises(FMICallException):
                    action()
            plant.step(0.0, 1e-3)  # and it goes on

    def test_other_versions_description_is_refused(self):
        path = self.export('plant')
        edited = self.folder / 'edited.fmu'
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(edited, 'w') as new:
            for name in old.namelist():
                data = old.read(name)
                new.writestr(name, data.replace(b'abs_hil-plant-', b'abs_hil-plant-0') if name.endswith('.xml') else data)
        with self.assertRaisesRegex(Exception, 'instantiate'):
            Instance(str(edited))

    def test_bad_input(self):
        for arguments, word in ((('--fmi', 4, '--out', self.folder / 'a.fmu'), '--fmi 4'),
                                (('--out', self.folder / 'nowhere' / 'a.fmu'), 'nowhere'),
                                (('--set', 'plant.theta_N=-1', '--out', self.folder / 'a.fmu'), 'plant.theta_N'),
                                (('--controller', 'nope', '--out', self.folder / 'a.fmu'), 'nope')):
            result = self.run_program('export-fmu', *arguments)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(str(word), result.stderr)
            self.assertEqual(len(result.stderr.strip().splitlines()), 1)
        self.assertEqual(list(self.folder.iterdir()), [])
        older = self.folder / 'older.fmu'
        older.write_text('older')
        result = self.run_program('export-fmu', '--out', older)
        self.assertEqual((result.returncode, older.read_text()), (2, 'older'))
        self.assertIn('--force', result.stderr)
        self.assertEqual(self.run_program('export-fmu', '--out', older, '--force').returncode, 0)
        self.assertTrue(zipfile.is_zipfile(older))

    def test_binary_brings_everything(self):
        if platform.system() != 'Linux':
            self.skipTest('ldd')
        library = pathlib.Path(PROGRAM).resolve().parent.parent / 'fmu/linux64/abs_hil_fmu.so'
        needed = subprocess.run(['ldd', library], capture_output=True, text=True, check=True).stdout
        for line in needed.splitlines():
            self.assertRegex(line, r'linux-vdso|libm\.so|libc\.so|ld-linux')
        self.assertTrue(SOURCE.exists())


if __name__ == '__main__':
    unittest.main(verbosity=2)
