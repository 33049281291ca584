"""Tests the message types for users: every field is documented, Python and Java have the published fingerprints, and
Python's decode() handles whole, damaged and foreign messages.

usage: types_test.py LCMTYPES PYTHON_MODULE_DIR [JAVA TYPES_JAR LCM_JAR FINGERPRINTS_CLASS_DIR]
"""
import pathlib
import re
import subprocess
import sys
import unittest

LCMTYPES, MODULE_DIR, *JAVA = sys.argv[1:]
sys.argv[1:] = []
sys.path.insert(0, MODULE_DIR)
import abs_hil  # noqa: E402  (the module under test)

FIELD = re.compile(r'^ *(?P<type>\w+) +(?P<name>\w+)(?:\[\w+\])?; *(?P<comment>//.*)?$')
RANGE = re.compile(r'>=|<=|> 0|in \[|\bany\b|one of')
UNIT_IN_NAME = {'_ns': 'ns', '_us': 'us', '_s': 's', '_rad_s': 'rad/s', '_m_s': 'm/s', '_Nm': 'N m', '_N': 'N', '_m': 'm',
                '_V': 'V', '_C': 'Celsius'}


def published():
    lines = pathlib.Path(LCMTYPES, 'fingerprints.txt').read_text().splitlines()
    return dict(line.split() for line in lines if line and not line.startswith('#'))


def undocumented(text):
    """What is wrong with the comments of a .lcm file's fields."""
    wrong = []
    for number, line in enumerate(text.splitlines(), 1):
        field = FIELD.match(line)
        if not field or field['type'] == 'package':
            continue
        comment = field['comment'] or ''
        if not comment:
            wrong.append(f'line {number}: {field["name"]} has no comment')
        elif field['type'] not in ('string', 'boolean') and not RANGE.search(comment):
            wrong.append(f'line {number}: {field["name"]} has no range')
        suffix = next((s for s in sorted(UNIT_IN_NAME, key=len, reverse=True) if field['name'].endswith(s)), None)
        if comment and suffix and not re.search(rf'\b{UNIT_IN_NAME[suffix]}\b', comment):
            # "99th percentile, us": a unit in the name must be the unit in the comment
            wrong.append(f'line {number}: {field["name"]} names no {UNIT_IN_NAME[suffix]}')
    return wrong


class Types(unittest.TestCase):
    def test_every_field_has_unit_and_range(self):
        for file in sorted(pathlib.Path(LCMTYPES).glob('*.lcm')):
            with self.subTest(file.name):
                self.assertEqual(undocumented(file.read_text()), [])

    def test_missing_comments_units_and_ranges_are_found(self):
        self.assertEqual(len(undocumented('double a_s;\ndouble b_s;  // b, s\ndouble c_s;  // c, ns, >= 0\n')), 3)

    def test_files_list_and_module_hold_the_same_types(self):
        files = {file.stem for file in pathlib.Path(LCMTYPES).glob('*.lcm')}
        self.assertEqual(files, set(published()), 'lcmtypes/*.lcm and fingerprints.txt')
        self.assertEqual(files, set(abs_hil.TYPES), 'lcmtypes/*.lcm and the Python module')

    def test_python_fingerprints(self):
        found = {name: type_._get_packed_fingerprint().hex() for name, type_ in abs_hil.TYPES.items()}
        self.assertEqual(found, published(), 'lcmtypes/README.md says how types change')

    def test_java_fingerprints(self):
        if not JAVA:
            self.skipTest('built without Java')
        java, *classpath = JAVA
        text = subprocess.run([java, '-cp', ':'.join(classpath), 'Fingerprints', *published()], check=True,
                              capture_output=True, text=True, timeout=60).stdout
        found = dict(line.split() for line in text.splitlines())
        self.assertEqual(found, published(), 'lcmtypes/README.md says how types change')


class Decode(unittest.TestCase):
    def event(self):
        event = abs_hil.event_t()
        event.sequence, event.kind, event.value = 7, 'phase', 0.1 + 0.2
        event.message = 'Schlupf größer als 0,2'
        return event

    def test_any_message_comes_back_as_its_own_type(self):
        for type_ in abs_hil.TYPES.values():
            self.assertIsInstance(abs_hil.decode(type_().encode()), type_)
        back = abs_hil.decode(self.event().encode())
        self.assertEqual((back.sequence, back.kind, back.value, back.message),
                         (7, 'phase', 0.1 + 0.2, 'Schlupf größer als 0,2'))

    def test_damaged_and_foreign_messages_are_value_errors(self):
        whole = self.event().encode()
        for size in range(len(whole)):
            with self.assertRaises(ValueError):
                abs_hil.decode(whole[:size])
        with self.assertRaisesRegex(ValueError, 'damaged event_t'):
            abs_hil.decode(whole + b'x')
        with self.assertRaisesRegex(ValueError, '0000000000000001.*telemetry_t'):
            abs_hil.decode(bytes(7) + b'\x01' + whole[8:])

    def test_phases_are_those_of_the_type(self):
        for number, name in enumerate(abs_hil.PHASES):
            self.assertEqual(getattr(abs_hil.telemetry_t, f'PHASE_{name.upper()}'), number)


class Tables(unittest.TestCase):
    #: quantities that the type has no field for, because they came after it: they travel in its values
    LATER = ['upper_edge_age_ns', 'lower_edge_age_ns']

    def test_quantities_are_the_fields_of_telemetry_and_its_first_values(self):
        beside = {'phase_name', 'names', 'value_count', 'values'}
        self.assertEqual((set(abs_hil.telemetry_t.__slots__) - beside) | set(self.LATER), set(abs_hil.QUANTITIES))

    def test_a_row_has_every_quantity_and_signal(self):
        message = abs_hil.telemetry_t()
        message.slip, message.names = 0.25, ','.join([*self.LATER, 'I_m', 'zeta_N'])
        message.values, message.value_count = [250.0, -1.0, 0.5, 15.0], 4
        row = abs_hil.row_of(abs_hil.decode(message.encode()))
        self.assertEqual((row['slip'], row['I_m'], row['zeta_N'], row['upper_edge_age_ns']), (0.25, 0.5, 15.0, 250.0))
        self.assertLessEqual(set(abs_hil.QUANTITIES), set(row))
        self.assertNotIn('names', row)

    def test_csv_columns_are_numbered_in_order(self):
        columns = [row['csv_column'] for row in abs_hil.QUANTITIES.values() if row['csv_column']]
        self.assertEqual(columns, list(range(1, len(columns) + 1)))
        self.assertEqual(abs_hil.QUANTITIES['time_s']['csv_column'], 1)

    def test_units_are_those_in_the_names(self):
        for name, row in abs_hil.QUANTITIES.items():
            suffix = next((s for s in sorted(UNIT_IN_NAME, key=len, reverse=True) if name.endswith(s)), None)
            with self.subTest(name):
                self.assertIn(UNIT_IN_NAME[suffix] if suffix else '', row['unit'])

    def test_reasons_have_number_kind_and_text(self):
        self.assertEqual(abs_hil.REASONS[34]['name'], 'stop_command')
        self.assertEqual(abs_hil.REASONS[65]['kind'], 'fault')
        self.assertTrue(all(row['text'] for row in abs_hil.REASONS.values()))


if __name__ == '__main__':
    unittest.main(verbosity=2)
