"""FMUs of every numeric type of FMI 2 and 3 as controllers, their inputs without a name, and URIs. usage: see foreign.py"""
import ctypes
import functools
import math
import os
import pathlib
import struct
import subprocess
import unittest
import xml.sax.saxutils
import zipfile

from foreign import CC, SOURCE  # first: it reads the arguments
from program import ProgramTest

try:
    from fmpy.validation import validate_fmu
except ImportError:  # scripts/setup_python.sh
    validate_fmu = None

START = ['--set', 'experiment.start_speed_rad_s=170', '--set', 'plant.ideal_sensors=true']
#: type -> least and greatest of its values
WHOLE = {'Int8': (-2**7, 2**7 - 1), 'UInt8': (0, 2**8 - 1), 'Int16': (-2**15, 2**15 - 1), 'UInt16': (0, 2**16 - 1),
         'Int32': (-2**31, 2**31 - 1), 'UInt32': (0, 2**32 - 1), 'Int64': (-2**63, 2**63 - 1), 'UInt64': (0, 2**64 - 1)}
TYPES = {2: ['Real', 'Integer', 'Boolean', 'Enumeration'], 3: ['Float64', 'Float32', *WHOLE, 'Boolean', 'Enumeration']}
NAMES = {'omega2_rad_s': 1, 'alpha2_rad_s2': 2, 'brake_torque_Nm': 3, 'theta_est_N': 4, 'slip_velocity_error_m_s': 5, 'torque': 6}


def functions_of(fmi, kind):
    """The type whose functions carry a kind of variable."""
    return {(2, 'Enumeration'): 'Integer', (3, 'Enumeration'): 'Int64'}.get((fmi, kind), kind)


def taken(fmi, kind, value):
    """The value in that type, by this test's own rules: the nearest of its values, halves away from zero."""
    if kind == 'Boolean':
        return float(value != 0.0)
    if kind == 'Float32':
        return struct.unpack('f', struct.pack('f', value))[0]
    if kind in ('Float64', 'Real'):
        return value
    least, most = WHOLE['Int32' if fmi == 2 else functions_of(fmi, kind)]
    return float(min(max(int(math.copysign(math.floor(abs(value) + 0.5), value)), least), most))


def start_of(kind):
    return {'Boolean': 'false', 'Enumeration': '1'}.get(kind, '0')


def variable(fmi, name, reference, kind, causality, inner='', start=True):
    declared = ' declaredType="Level"' if kind == 'Enumeration' else ''
    begins = start and causality != 'output'
    variability = 'fixed' if causality == 'parameter' else 'continuous' if kind in ('Real', 'Float64', 'Float32') else 'discrete'
    facts = f'name={xml.sax.saxutils.quoteattr(name)} valueReference="{reference}" causality="{causality}" variability="{variability}"'
    if causality == 'output':
        facts += ' initial="calculated"'
    value = f' start="{start_of(kind)}"' if begins else ''
    if fmi == 2:
        return f'<ScalarVariable {facts}><{kind}{declared}{value}/></ScalarVariable>'
    if kind in ('String', 'Binary'):
        inner, value = '<Start value="00"/>' if begins else '', ''
    return f'<{kind} {facts}{declared}{value if kind != "Clock" else ""}>{inner}</{kind}>'


def description(fmi, variables):
    items = ''.join(f'<Item name="e{n}" value="{n}"/>' for n in range(1, 256))
    level = ('<SimpleType name="Level"><Enumeration>%s</Enumeration></SimpleType>' if fmi == 2 else
             '<EnumerationType name="Level">%s</EnumerationType>') % items
    outputs = [(n, text) for n, text in enumerate(variables, 1) if 'causality="output"' in text]
    if fmi == 2:
        return ('<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="2.0" modelName="typed" guid="typed">'
                '<CoSimulation modelIdentifier="typed" canHandleVariableCommunicationStepSize="true"/>'
                f'<TypeDefinitions>{level}</TypeDefinitions><ModelVariables>{"".join(variables)}</ModelVariables><ModelStructure>'
                f'<Outputs>{"".join(f"<Unknown index={chr(34)}{n}{chr(34)}/>" for n, _ in outputs)}</Outputs><InitialUnknowns>'
                f'{"".join(f"<Unknown index={chr(34)}{n}{chr(34)}/>" for n, _ in outputs)}</InitialUnknowns>'
                '</ModelStructure></fmiModelDescription>')
    references = [text.split('valueReference="')[1].split('"')[0] for _, text in outputs]
    return ('<?xml version="1.0" encoding="UTF-8"?>\n<fmiModelDescription fmiVersion="3.0" modelName="typed" instantiationToken="typed">'
            '<CoSimulation modelIdentifier="typed" canHandleVariableCommunicationStepSize="true"/>'
            f'<TypeDefinitions>{level}</TypeDefinitions><ModelVariables>'
            '<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>'
            f'{"".join(variables)}</ModelVariables><ModelStructure>{"".join(f"<Output valueReference={chr(34)}{r}{chr(34)}/>" for r in references)}'
            f'{"".join(f"<InitialUnknown valueReference={chr(34)}{r}{chr(34)}/>" for r in references)}</ModelStructure>'
            '</fmiModelDescription>')


def of_one_type(fmi, kind):
    causality = {1: 'input', 2: 'input', 6: 'parameter'}
    return [variable(fmi, name, n, kind, causality.get(n, 'output')) for name, n in NAMES.items()]


class Types(ProgramTest):
    @classmethod
    @functools.cache
    def library(cls, fmi, kind):
        cls.built = getattr(cls, 'built', None) or pathlib.Path(os.environ.get('TMPDIR', '/tmp'), f'abs_hil_types.{os.getpid()}')
        cls.built.mkdir(exist_ok=True)
        path = cls.built / f'{fmi}{kind}.so'
        subprocess.run([CC, '-std=gnu99', '-shared', '-fPIC', '-O1', '-Wall', '-Wextra', '-Werror', '-Wno-unused-parameter',
                        f'-I{SOURCE / "third_party"}', f'-DFMI={fmi}', f'-DTYPE={kind}', '-o', path,
                        SOURCE / 'tests/interchange/typed_controller.c'], check=True)
        return path.read_bytes()

    @classmethod
    def tearDownClass(cls):
        for path in cls.built.iterdir():
            path.unlink()
        cls.built.rmdir()

    def fmu(self, fmi, kind, variables=None):
        path = self.folder / 'typed.fmu'
        folder = {2: 'linux64', 3: 'x86_64-linux'}[fmi]
        with zipfile.ZipFile(path, 'w') as archive:
            archive.writestr('modelDescription.xml', description(fmi, variables or of_one_type(fmi, kind)))
            archive.writestr(f'binaries/{folder}/typed.so', self.library(fmi, functions_of(fmi, kind)))
        return path

    def mapping(self, text):
        path = self.folder / 'map.toml'
        path.write_text(text)
        return ['--set', f'control.foreign.mapping={path}']

    def copies(self, fmi, kind, torque):
        """What the controller copied of speed and acceleration, and the torque asked for, cycle by cycle."""
        path = self.fmu(fmi, kind)
        if validate_fmu is not None:
            self.assertEqual(validate_fmu(str(path)), [], (fmi, kind))
        csv = self.folder / 'run.csv'
        self.fast('--controller', path, *self.mapping(f'[parameters]\ntorque = {torque}\n'), '--csv', csv, '--set',
                  'control.rate_Hz=100', *START)
        rows = [row for row in self.rows(csv) if row['phase'] == 'brake']
        return [[float(row[name]) for row in rows]
                for name in ('theta_est_N', 'slip_velocity_error_m_s', 'brake_torque_ref_Nm', 'omega2_est_rad_s')]

    def test_every_type_carries_its_nearest_value(self):
        reference = {torque: self.copies(3, 'Float64', torque) for torque in (5, 1)}
        speeds, accelerations, torques, known = reference[5]
        self.assertEqual(speeds[1:], known[1:])
        self.assertGreater(max(speeds), 127.0)  # beyond Int8
        self.assertLess(min(accelerations), -1.0)
        self.assertAlmostEqual(max(torques), 5.0, delta=0.01)  # on the steps of the PWM
        for fmi, kinds in TYPES.items():
            for kind in kinds:
                with self.subTest(fmi=fmi, type=kind):
                    flag = kind == 'Boolean'
                    speed, acceleration, torque, _ = self.copies(fmi, kind, 'true' if flag else 5)
                    given = reference[1 if flag else 5]
                    self.assertEqual(len(speed), len(given[0]))
                    self.assertEqual(torque, given[2])
                    for its, values in ((speed, given[0]), (acceleration, given[1])):
                        for value, exact in zip(its, values):
                            self.assertAlmostEqual(value, taken(fmi, kind, exact), delta=1e-5 * abs(exact))

    def refused(self, path, *words, options=(), never=()):
        result = self.run_program('--fast', '--no-lcm', '--controller', path, *options, *START)
        self.assertEqual(result.returncode, 2, (words, result.stdout, result.stderr))
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        for word in never:
            self.assertNotIn(word, result.stderr)

    def runs(self, path, *options, **kwargs):
        """It is taken. Without a torque the car does not stop in time."""
        result = self.run_program('--fast', '--no-lcm', '--controller', path, '--set', 'control.rate_Hz=100', *options, *START,
                                  **kwargs)
        self.assertIn(result.returncode, (0, 1), result.stderr)
        self.assertIn('controller ' + str(path), result.stdout)
        return result

    def test_parameters_must_fit_their_type(self):
        for fmi, kind, value, fits in ((3, 'Int8', '127', True), (3, 'Int8', '128', False), (3, 'UInt8', '-1', False),
                                       (3, 'Int64', '5.0', False), (3, 'Boolean', '1', False), (2, 'Integer', '2147483648', False),
                                       (3, 'Float32', '"5"', False), (3, 'UInt16', 'true', False), (2, 'Real', '5', True)):
            with self.subTest(kind, value=value):
                path, names = self.fmu(fmi, kind), self.mapping(f'\n[parameters]\ntorque = {value}\n')
                if fits:
                    self.runs(path, *names)
                else:
                    self.refused(path, 'map.toml, line 3', '"torque"', kind, options=names)

    def test_all_inputs_without_a_name_are_named_with_the_lines_that_map_them(self):
        for fmi, kind in ((2, 'Real'), (3, 'Float32')):
            others = [variable(fmi, f'in{n}', 10 + n, kind, 'input') for n in range(6)]
            path = self.fmu(fmi, kind, of_one_type(fmi, kind) + others)
            lines = [f'"in{n}" = "start"' for n in range(6)]
            self.refused(path, *(f'"in{n}"' for n in range(6)), *lines, '[inputs]', 'control.foreign.mapping', 'unsent_torque_Nm')
            self.refused(path, *lines[1:], options=self.mapping(f'[inputs]\n{lines[0]}\n'), never=lines[:1])
            self.runs(path, *self.mapping('[inputs]\n' + '\n'.join(lines)))

    def test_everything_that_is_wrong_is_said_at_once(self):
        path = self.fmu(3, 'Float64', [variable(3, 'lam', 1, 'Float64', 'input'), variable(3, 'Tb', 3, 'Float64', 'output')])
        self.refused(path, '"lam" = "start"', 'no output brake_torque_Nm', '"Tb"')
        self.refused(path, 'map.toml, line 2: it has no variable "lan"; the nearest is lam', 'map.toml, line 4: outputs."Tb": give one of',
                     'brake_torque_Nm, slip_velocity_error_m_s', '"lam" = "start"',
                     options=self.mapping('[inputs]\n"lan" = "slip"\n[outputs]\n"Tb" = "torque"\n'))

    def test_what_is_no_single_number_is_refused_by_name(self):
        numbers = of_one_type(3, 'Float64')
        for kind, start, fits in (('String', True, True), ('Binary', True, True), ('String', False, False), ('Binary', False, False),
                                  ('Clock', False, False)):
            with self.subTest(kind, start=start):
                path = self.fmu(3, 'Float64', [*numbers, variable(3, 'extra', 9, kind, 'input', start=start)])
                if fits:
                    self.runs(path)
                else:
                    self.refused(path, '"extra" = "start"')
                self.refused(path, '"extra"', f'type {kind}', 'line 2', options=self.mapping('[inputs]\nextra = "slip"\n'))
        array = variable(3, 'slip', 9, 'Float64', 'input', inner='<Dimension start="3"/>')
        path = self.fmu(3, 'Float64', [*numbers, array])
        self.refused(path, '"slip" is an array of type Float64')
        self.runs(path, *self.mapping('[inputs]\nslip = "start"\n'))
        torque = [text.replace('/>', '>').replace('></Float64>', '><Dimension start="2"/></Float64>')
                  if 'brake_torque_Nm' in text else text for text in numbers]
        self.refused(self.fmu(3, 'Float64', torque), '"brake_torque_Nm" is an array')

    def test_resources_have_the_uri_of_the_standard(self):
        """As Python's own library makes it; FMI 3 has a path in place of it."""
        for name in ('plain', 'with space', 'a%41b', '50% of it', 'ü制', "a'b", 'a#b?c', 'x:y', 'a&b=c;d', '\\', '~'):
            place = self.folder / name
            place.mkdir()
            for fmi, kind in ((2, 'Real'), (3, 'Float64')):
                with self.subTest(name, fmi=fmi):
                    result = self.runs(self.fmu(fmi, kind), env={**os.environ, 'TMPDIR': str(place)})
                    told = next(line for line in result.stderr.splitlines() if line.startswith('resources: '))[11:]
                    folder = place / told.rstrip('/').split('/')[-2] / 'resources'
                    self.assertEqual(told, folder.as_uri() if fmi == 2 else f'{folder}/')

    def test_own_fmus_read_every_form_of_the_uri(self):
        place = self.folder / '50% of ü #1'
        place.mkdir()
        for fmi in (2, 3):
            own = self.folder / f'own{fmi}.fmu'
            self.assertEqual(self.run_program('export-fmu', '--controller', 'pi', '--fmi', fmi, '--out', own).returncode, 0)
            zipfile.ZipFile(own).extractall(place / str(fmi))
            root = place / str(fmi)
            text = (root / 'modelDescription.xml').read_text()
            token = text.split('guid="' if fmi == 2 else 'instantiationToken="')[1].split('"')[0]
            library = ctypes.CDLL(str(next((root / 'binaries').glob('*linux*/*.so'))))
            resources = root / 'resources'
            uri = resources.as_uri()
            forms = [uri, f'{uri}/', uri.replace('file:///', 'file:/'), uri.replace('file:///', 'file://localhost/'),
                     uri.replace('file:', 'FILE:'), str(resources), f'{resources}/']
            for form, works in [*((form, True) for form in forms), (f'{uri}x', False), (uri.replace('%25', '%2525'), False),
                                (uri.replace('file:///', 'file://server/'), False)]:
                with self.subTest(form, fmi=fmi):
                    self.assertEqual(self.made(library, fmi, token, form), works)

    @staticmethod
    def made(library, fmi, token, resources):
        """True if the library makes an instance."""
        if fmi == 2:
            callbacks = (ctypes.c_void_p * 5)()
            make = library.fmi2Instantiate
            arguments = [b'i', 1, token.encode(), resources.encode(), callbacks, 0, 0]
        else:
            make = library.fmi3InstantiateCoSimulation
            arguments = [b'i', token.encode(), resources.encode(), *(ctypes.c_bool(False),) * 4, None, ctypes.c_size_t(0), None, None, None]
        make.restype = ctypes.c_void_p
        instance = make(*arguments)
        if instance:
            free = library.fmi2FreeInstance if fmi == 2 else library.fmi3FreeInstance
            free.argtypes = [ctypes.c_void_p]
            free.restype = None
            free(instance)
        return bool(instance)


if __name__ == '__main__':
    unittest.main()
