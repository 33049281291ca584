"""Controllers from FMUs: one of ours, those of two other exporters, and FMUs that do not fit. usage: see foreign.py"""
import io
import os
import pathlib
import stat
import subprocess
import sys
import sysconfig
import unittest
import unittest.mock
import zipfile

from foreign import SOURCE, broken, compiled  # first: it reads the arguments
from rig_emulator import RigTest, why_not

try:
    from fmpy.fmucontainer import Component, Configuration, DefaultExperiment, Variable, create_fmu_container
    from pythonfmu.builder import FmuBuilder
except ImportError as error:
    print(f'SKIPPED: {error}: scripts/setup_python.sh')
    sys.exit(77)

START = ['--set', 'experiment.start_speed_rad_s=170']
IDEAL = ['--set', 'plant.ideal_sensors=true', '--set', 'plant.ideal_actuator=true']
COUNTS = '[inputs]\nupper_counts = "start"\nlower_counts = "start"\n'
OUTPUT = '[outputs]\n"brake_torque_ref_Nm" = "brake_torque_Nm"\n' + COUNTS


class ForeignFmu(RigTest):
    def export(self, fmi=2, rate_Hz=1000):
        path = self.folder / f'law{fmi}.fmu'
        result = self.run_program('export-fmu', '--controller', 'adaptive', '--fmi', fmi, '--out', path, '--force', *START, *IDEAL,
                                  '--set', f'control.rate_Hz={rate_Hz}')
        self.assertEqual(result.returncode, 0, result.stderr)
        return path

    def container(self, rate_Hz=1000):
        """An FMU that FMPy exports, whose library is FMPy's; ours is a part of it."""
        names = (('input', 'w1', 'omega1_rad_s'), ('input', 'w2', 'omega2_rad_s'), ('output', 'Tb', 'brake_torque_ref_Nm'))
        variables = [Variable(type='Real', causality=causality, variability='continuous', name=name,
                              start='0' if causality == 'input' else None, initial='calculated' if causality == 'output' else None,
                              mapping=[('law', inner)]) for causality, name, inner in names]
        law, path = self.export(rate_Hz=rate_Hz), self.folder / 'container.fmu'
        create_fmu_container(Configuration(fmiVersion='2.0', variables=variables,
                                           defaultExperiment=DefaultExperiment(startTime='0', stepSize=str(1 / rate_Hz)),
                                           components=[Component(filename=str(law), name='law')]), str(path))
        return path

    def mapping(self, text):
        path = self.folder / 'map.toml'
        path.write_text(text)
        return ['--set', f'control.foreign.mapping={path}']

    def stop(self, *options):
        summary = self.folder / 'summary.json'
        self.fast('--summary', summary, *START, *IDEAL, *options)
        return self.summary(summary)

    def test_own_fmus_stop_as_their_law(self):
        own = self.stop('--controller', 'adaptive')
        for fmi in (2, 3):
            its = self.stop('--controller', self.export(fmi), *self.mapping(OUTPUT + '[parameters]\n"control.slip_ref" = 0.15\n'))
            print(f'FMI {fmi}: {its["stop_distance_m"]} m, adaptive {own["stop_distance_m"]} m')
            self.assertAlmostEqual(its['stop_distance_m'] / own['stop_distance_m'], 1.0, delta=0.001)
        other = self.stop('--controller', self.export(2), *self.mapping(OUTPUT + '[parameters]\n"control.slip_ref" = 0.3\n'))
        self.assertNotAlmostEqual(other['stop_distance_m'] / own['stop_distance_m'], 1.0, delta=0.001)

    def test_an_fmu_packed_by_cmake(self):
        """As the Modelica Association's Reference-FMUs are: with libarchive, which tells sizes behind the data."""
        own, contents, packed = self.export(), self.folder / 'contents', self.folder / 'packed.fmu'
        zipfile.ZipFile(own).extractall(contents)
        subprocess.run(['cmake', '-E', 'tar', 'cf', packed, '--format=zip', *os.listdir(contents)], cwd=contents, check=True)
        self.assertTrue(all(entry.flag_bits & 8 for entry in zipfile.ZipFile(packed).infolist() if not entry.is_dir()))
        stops = [self.stop('--controller', path, *self.mapping(OUTPUT))['stop_distance_m'] for path in (own, packed)]
        self.assertEqual(*stops)

    def test_an_fmu_of_another_exporter(self):
        names = self.mapping('[inputs]\nw1 = "omega1_rad_s"\nw2 = "omega2_rad_s"\n[outputs]\nTb = "brake_torque_Nm"\n')
        path, unpacked = self.container(), self.folder / 'unpacked'
        unpacked.mkdir()
        with unittest.mock.patch.dict(os.environ, TMPDIR=str(unpacked)):
            own, its = self.stop('--controller', 'adaptive'), self.stop('--controller', path, *names)
        print(f'container: {its["stop_distance_m"]} m, adaptive {own["stop_distance_m"]} m')
        self.assertAlmostEqual(its['stop_distance_m'] / own['stop_distance_m'], 1.0, delta=0.001)
        self.assertEqual(os.listdir(unpacked), [])

    def test_a_law_in_python(self):
        """PythonFMU's library, and no line of ours: the law stops where the same law in C stops."""
        FmuBuilder.build_FMU(SOURCE / 'tests/interchange/proportional_law.py', dest=self.folder)
        made = self.folder / 'ProportionalLaw.fmu'
        names = self.mapping('[inputs]\nlam = "slip"\n[outputs]\nTb = "brake_torque_Nm"\n[parameters]\nwanted = 0.3\n')
        self.refused(made, 'needs the tool that made it', options=names)

        def with_its_tool(entry, data):
            return [(entry, data.replace(b'needsExecutionTool="true"', b'needsExecutionTool="false"'))]
        # Its library takes Python's functions from the program around it.
        python = pathlib.Path(sysconfig.get_config_var('LIBDIR'), sysconfig.get_config_var('INSTSONAME'))
        with unittest.mock.patch.dict(os.environ, LD_PRELOAD=str(python)):
            its = self.stop('--controller', self.edited(with_its_tool, source=made), *names)
        same = compiled(self.folder, SOURCE / 'tests/interchange/proportional_law.c', 'proportional')
        own = self.stop('--controller', same)
        print(f'Python: {its["stop_distance_m"]} m, C: {own["stop_distance_m"]} m')
        self.assertEqual(its['stop_distance_m'], own['stop_distance_m'])

    @unittest.skipIf(why_not(), why_not())
    def test_on_the_emulated_card_in_real_time(self):
        names = self.mapping('[inputs]\nw1 = "omega1_rad_s"\nw2 = "omega2_rad_s"\n[outputs]\nTb = "brake_torque_Nm"\n')
        # 1 kHz leaves the emulator's file system no spare time if another program runs at the same time.
        path, summary = self.container(rate_Hz=500), self.folder / 'summary.json'
        emulator = self.emulator()
        program = self.real_time(emulator, '--controller', path, *names, '--rt', 'prefer', '--rate', '500', '--summary', summary)
        _, errors = program.communicate(timeout=60)
        self.assertEqual(program.returncode, 0, errors)
        foreign = self.summary(summary)['foreign_controller']
        print(foreign)
        self.assertGreater(foreign['steps'], 100)
        self.assertGreater(foreign['step_us']['max'], 0)
        self.assertEqual(foreign['trial']['steps'], 2000)

    def edited(self, change, name='edited', source=None):
        """A copy of an FMU; `change` gives the entries to write for each entry of it."""
        path = self.folder / f'{name}.fmu'
        with zipfile.ZipFile(source or self.export()) as old, zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as new:
            for entry in old.namelist():
                for changed, data in change(entry, old.read(entry)):
                    new.writestr(changed, data)
        return path

    def refused(self, path, *words, options=(), code_ran=False):
        """code_ran: the library's constructor, in its own process."""
        trace = self.folder / 'trace'
        result = self.run_program('--fast', '--no-lcm', '--controller', path, *options,
                                  env={**os.environ, 'ABS_HIL_TRACE': str(trace)})
        self.assertEqual(result.returncode, 2, (words, result.stdout, result.stderr))
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        self.assertEqual(trace.exists(), code_ran)
        trace.unlink(missing_ok=True)

    def description(self, old, new):
        def change(entry, data):
            return [(entry, data.replace(old, new) if entry == 'modelDescription.xml' else data)]
        return self.edited(change)

    def test_what_does_not_fit_is_refused(self):
        mapping = self.mapping(OUTPUT)
        self.refused(self.edited(lambda e, d: [] if 'linux64' in e else [(e, d)]), 'libraries for win64 only', options=mapping)
        self.refused(self.edited(lambda e, d: [] if e.startswith('binaries') else [(e, d)]), 'no binaries', options=mapping)
        self.refused(self.description(b'modelIdentifier="abs_hil_fmu"', b'modelIdentifier="other"'), 'other.so', options=mapping)
        self.refused(self.description(b'CoSimulation', b'ModelExchange'), 'not for co-simulation', options=mapping)
        self.refused(self.description(b'fmiVersion="2.0"', b'fmiVersion="1.0"'), '"1.0"', options=mapping)
        self.refused(self.description(b'</fmiModelDescription>', b''), 'damaged modelDescription.xml', options=mapping)
        self.refused(self.edited(lambda e, d: [] if e.endswith('.xml') else [(e, d)]), 'no modelDescription.xml')
        self.refused(self.export(), 'input "lower_counts"', 'omega2_rad_s, slip', 'in the table [inputs]',
                     options=self.mapping(OUTPUT.replace('lower_counts = "start"', '')))
        for text, words in ((OUTPUT + '"nothing" = "slip"\n', ('"nothing"',)), (OUTPUT + '"other" = "start"\n', ('"other"',)),
                            (OUTPUT + '"slip_est" = "slip"\n', ('slip_est', 'causality output')),
                            (COUNTS + '[outputs]\n"omega1_rad_s" = "brake_torque_Nm"\n', ('omega1_rad_s', 'causality input')),
                            (OUTPUT + '"omega1_rad_s" = "speed"\n', ('omega2_rad_s, slip',)),
                            (COUNTS, ('no output brake_torque_Nm',)),
                            (OUTPUT + '[parameters]\n"control.slip_ref" = "high"\n', ('control.slip_ref', 'Real')),
                            ('[outputs\n', ('line 1',)), ('[names]\n', ('inputs, outputs, parameters',))):
            self.refused(self.export(), *words, options=self.mapping(text))

    def test_a_damaged_description_is_refused(self):
        for old, new, words in ((b'name="slip_est" valueReference="', b'name="slip_est" other="', 'the valueReference ""'),
                                (b'name="slip_est" valueReference="', b'name="slip_est" valueReference="-', 'valueReference "-'),
                                (b'name="slip_est" valueReference="', b'name="slip_est" valueReference="99999999', '"99999999'),
                                (b'name="omega2_rad_s"', b'name="omega1_rad_s"', 'two variables "omega1_rad_s"')):
            self.refused(self.description(old, new), 'damaged modelDescription.xml', words, options=self.mapping(OUTPUT))

    def test_a_call_that_fails_is_named_with_its_status_and_step(self):
        names = self.mapping(OUTPUT)
        for fmi in (2, 3):  # no step of theirs may be shorter than their own period
            law = self.export(fmi, rate_Hz=100)
            result = self.run_program('--fast', '--no-lcm', '--no-out', '--controller', law, *names, *START, *IDEAL)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn(f'its fmi{fmi}DoStep returned fmi{fmi}Error in step 1', result.stderr)
        result = self.run_program('--no-lcm', '--no-out', '--rt', 'off', '--controller', self.export(2, 100), *names)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('in a trial its fmi2DoStep returned fmi2Error in step 1', result.stderr)

    def test_hostile_archives_are_refused(self):
        mapping = self.mapping(OUTPUT)

        def with_entry(name, data=b'x'):
            return self.edited(lambda e, d: [(e, d), (name, data)] if e == 'modelDescription.xml' else [(e, d)])
        self.refused(with_entry('../evil'), '"../evil" leads out', options=mapping)
        self.refused(with_entry('resources/../../evil'), 'leads out', options=mapping)
        self.refused(with_entry('/tmp/evil'), 'leads out', options=mapping)
        self.refused(with_entry('resources\\..\\evil'), 'leads out', options=mapping)
        link = zipfile.ZipInfo('resources/link')
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        link.create_system = 3
        self.refused(with_entry(link, b'/etc/passwd'), 'symbolic link', options=mapping)
        self.refused(with_entry('resources/bomb', b'\0' * (300 << 20)), 'bytes; it is not extracted', options=mapping)
        many = self.folder / 'many.fmu'
        with zipfile.ZipFile(many, 'w') as archive:
            for n in range(10_001):
                archive.writestr(f'resources/{n}', b'')
        self.refused(many, '10001 files')
        self.assertFalse((self.folder.parent / 'evil').exists())

    def test_damaged_archives_are_refused(self):
        mapping = self.mapping(OUTPUT)
        whole = self.export().read_bytes()
        for name, data in (('empty', b''), ('text', b'hello' * 100), ('half', whole[:len(whole) // 2])):
            path = self.folder / f'{name}.fmu'
            path.write_bytes(data)
            self.refused(path, 'cannot be read as a zip archive', options=mapping)
        place = whole.index(b'binaries/linux64') + 5000
        path = self.folder / 'flipped.fmu'
        path.write_bytes(whole[:place] + b'\0' * 64 + whole[place + 64:])
        self.refused(path, 'damaged', options=mapping)
        self.refused(self.folder / 'nowhere.fmu', 'nowhere.fmu')
        (self.folder / 'folder.fmu').mkdir()
        self.refused(self.folder / 'folder.fmu', 'folder.fmu', 'no regular file')

    def test_library_without_functions_does_not_run(self):
        library = broken(self.folder, 'SOUND').read_bytes()
        path = self.edited(lambda e, d: [(e, library if e.endswith('.so') else d)])
        self.refused(path, 'does not define fmi2Instantiate', options=self.mapping(OUTPUT), code_ran=True)
        path = self.edited(lambda e, d: [(e, io.BytesIO(b'#!/bin/sh').read() if e.endswith('.so') else d)])
        self.refused(path, 'not a shared library', options=self.mapping(OUTPUT))


if __name__ == '__main__':
    unittest.main(verbosity=2)
