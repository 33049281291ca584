#!/usr/bin/env python3
"""usage: one_row_test.py SOURCE BUILD [FOLDER]

A quantity is one row and one line of .lcm, an option is one row, a reason is one row. The test adds a made-up one of
each to a copy of the tree, builds the program and the Python module, and looks for them wherever they must show. It
also takes the line of .lcm away again, and the row, and expects the compiler to say what is missing.

SOURCE is the source tree, BUILD a build of it, whose compiler, generator and compiler cache are used. The copy stands
in a temporary folder, or in FOLDER, which stays.
"""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile

from scratch_copy import ScratchCopy

QUANTITIES = 'include/abs_hil/rig/quantities.hpp'
MESSAGE = 'lcmtypes/telemetry_t.lcm'
OPTIONS = 'include/abs_hil/control/baseline_options.hpp'
REASONS = 'include/abs_hil/rig/reason.hpp'

# phase_index is part of every record and no other quantity: what comes out of a log went into it by this row.
QUANTITY_ROW = ('    Quantity{"made_up_index", "", "9.9", Topic::board, Outlet::both, '
                '[](auto& c) -> auto& { return c.record.phase_index; }, "made-up meaning"},')
MESSAGE_LINE = '    int16_t made_up_index;  // made-up meaning'
OPTION = 'control.relay.made_up_gain'
OPTION_ROW = ('  ABS_HIL_OPTION(double, made_up_gain, 1.5, .unit = "N m", .meaning = "made-up gain", '
              '.range = rig::between(0.25, 4));')
REASON_TEXT = 'made-up end of a run'


def add_rows(copy):
    """One line each. Returns the number of the reason."""
    for name in (QUANTITIES, MESSAGE, OPTIONS, REASONS):
        assert 'made_up' not in (copy.tree / name).read_text(encoding='utf-8'), name
    copy.insert_before(QUANTITIES, 'inline constexpr std::tuple quantities{', '};', QUANTITY_ROW)
    copy.insert_before(MESSAGE, 'struct telemetry_t {', '}', MESSAGE_LINE)
    copy.insert_before(OPTIONS, 'struct RelayOptions {', '};', OPTION_ROW)
    numbers = re.findall(r'^  ROW\(\w+, (\d+),', (copy.tree / REASONS).read_text(encoding='utf-8'), re.MULTILINE)
    number = max(map(int, numbers)) + 1
    copy.insert_before(REASONS, '#define ABS_HIL_REASONS(ROW)', '  /* the end of the rows */',
                       f'  ROW(made_up, {number}, fault, no, "{REASON_TEXT}") \\')
    for name in (QUANTITIES, MESSAGE, OPTIONS, REASONS):
        assert copy.changed_lines(name) == (1, 0), f'{name}: {copy.changed_lines(name)} lines added and removed'
    return number


def columns_of(path):
    with open(path, encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def quantity_in_generated_types(copy):
    types = copy.build / 'lcmtypes' / 'cpp' / 'abs_hil'
    assert 'Field{"made_up_index", &telemetry_t::made_up_index}' in (types / 'message_fields.hpp').read_text()
    assert 'made_up_index;' in (types / 'telemetry_t.hpp').read_text()


def quantity_in_files(copy, program):
    """In the CSV of a run, and by way of an event log in the CSV that `convert` makes of it."""
    run = copy.build / 'run.csv'
    log = copy.build / 'run.lcmlog'
    converted = copy.build / 'converted.csv'
    copy.run(program, '--fast', '--no-lcm', '--csv', run, '--log', log)
    columns = run.read_text().split('\n', 1)[0].split(',')
    # The phase's name and the controller's own signals follow the table's columns.
    assert columns[columns.index('wheels_apart') + 1] == 'made_up_index', columns
    rows = columns_of(run)
    phases = list(dict.fromkeys(row['phase'] for row in rows))
    assert len(phases) > 3, phases
    for row in rows:  # the paper's experiment names each phase once, and all begin one after the other
        assert row['made_up_index'] == str(phases.index(row['phase'])), row
    converted.unlink(missing_ok=True)
    copy.run(program, 'convert', log, converted)
    again = [row['made_up_index'] for row in columns_of(converted) if row['type'] == 'telemetry_t']
    assert again == [row['made_up_index'] for row in rows]


def option_in_lists(copy, program):
    lines = [line.split() for line in copy.run(program, 'list', '--keys').splitlines()]
    assert [OPTION, '1.5', '[0.25,', '4]', 'N', 'm;', 'made-up', 'gain'] in lines
    schema = json.loads(copy.run(program, 'validate', '--schema'))
    entry = schema['properties']['settings']
    for part in OPTION.split('.'):
        entry = entry['properties'][part]
    assert (entry['type'], entry['minimum'], entry['maximum']) == ('number', 0.25, 4), entry
    assert 'made-up gain' in entry['description'], entry


def option_takes_values(copy, program):
    """By --set and from a file; one out of range is refused with its range."""
    summary = copy.build / 'run.json'
    settings = copy.build / 'made_up.toml'
    settings.write_text('[control.relay]\nmade_up_gain = 0.5\n')
    for given, value in (([], 1.5), (['--set', f'{OPTION}=4'], 4), (['--config', settings], 0.5)):
        copy.run(program, '--fast', '--no-lcm', '--summary', summary, *given)
        assert json.loads(summary.read_text())['config']['control']['relay']['made_up_gain'] == value, given
    refusal = copy.run(program, '--fast', '--no-lcm', '--set', f'{OPTION}=5', status=2)
    for part in (f'{OPTION} = 5', '[0.25, 4]', 'made-up gain'):
        assert part in refusal, refusal


def tables_of_the_program(copy, program, number):
    row = json.loads(copy.run(program, 'list', '--quantities', '--json'))[-1]
    assert (row['name'], row['since'], row['lcm'], row['meaning']) == ('made_up_index', '9.9', True, 'made-up meaning')
    columns = (copy.build / 'run.csv').read_text().split('\n', 1)[0].split(',')
    assert columns[row['csv_column'] - 1] == 'made_up_index', row
    assert 'made_up_index' in copy.run(program, 'list', '--quantities')
    rows = json.loads(copy.run(program, 'list', '--reasons', '--json'))
    made_up = {'number': number, 'name': 'made_up', 'kind': 'fault', 'found_again': 'no', 'text': REASON_TEXT,
               'quantity': '', 'unit': '', 'bound': ''}
    assert made_up in rows
    assert REASON_TEXT in copy.run(program, 'list', '--reasons')


def tables_of_the_pages(copy):
    """The documentation's tables lack the rows, are found out, and get them."""
    script = ('scripts/docs_tables.py',)
    assert 'docs/telemetry.md' in copy.run(sys.executable, *script, '--check', copy.build, status=1)
    copy.run(sys.executable, *script, '--write', copy.build)
    copy.run(sys.executable, *script, '--check', copy.build)
    page = (copy.tree / 'docs' / 'telemetry.md').read_text(encoding='utf-8')
    assert page.count('| `made_up_index` |') == 1 and page.count(f'| {REASON_TEXT} |') == 1
    assert copy.changed_lines('docs/telemetry.md') == (2, 0), copy.changed_lines('docs/telemetry.md')


def tables_of_python(copy, number):
    code = ('import abs_hil\n'
            'print(abs_hil.QUANTITIES["made_up_index"]["meaning"])\n'
            f'print(abs_hil.REASONS[{number}]["text"])\n'
            'message = abs_hil.telemetry_t()\n'
            'message.made_up_index = 7\n'
            'print(abs_hil.decode(message.encode()).made_up_index)\n')
    environment = {**copy.environment, 'PYTHONPATH': str(copy.build / 'share' / 'abs_hil' / 'python')}
    said = subprocess.run([sys.executable, '-c', code], env=environment, check=True, capture_output=True, text=True)
    assert said.stdout.splitlines() == ['made-up meaning', REASON_TEXT, '7'], said.stdout


def halves_are_refused(copy):
    """The line of .lcm without the row, and the row without the line: the compiler names what is missing."""
    codec = 'src/telemetry/message_codec.cpp'
    assert copy.compiler_says('telemetry', codec) == ''
    copy.change(MESSAGE, MESSAGE_LINE + '\n', '')
    copy.make('abs_hil_lcmtypes_generate')
    message = copy.compiler_says('telemetry', codec)
    assert 'telemetry_t.lcm has no field of its name' in message and 'made_up_index' in message, message
    copy.insert_before(MESSAGE, 'struct telemetry_t {', '}', MESSAGE_LINE)
    copy.change(QUANTITIES, QUANTITY_ROW + '\n', '')
    copy.make('abs_hil_lcmtypes_generate')
    message = copy.compiler_says('telemetry', codec)
    assert 'has no row for LCM in rig/quantities.hpp' in message and 'made_up_index' in message, message


def test(copy):
    number = add_rows(copy)
    copy.configure()
    copy.make('abs_hil_lcmtypes_generate')
    quantity_in_generated_types(copy)
    copy.make('abs_hil_executable', 'abs_hil_python')
    program = copy.build / 'bin' / 'abs_hil'
    quantity_in_files(copy, program)
    option_in_lists(copy, program)
    option_takes_values(copy, program)
    tables_of_the_program(copy, program, number)
    tables_of_the_pages(copy)
    tables_of_python(copy, number)
    halves_are_refused(copy)


def main():
    root, build, *folder = (pathlib.Path(path).resolve() for path in sys.argv[1:])
    if folder:
        test(ScratchCopy(root, build, folder[0]))
    else:
        with tempfile.TemporaryDirectory(prefix='abs_hil_one_row.') as temporary:
            test(ScratchCopy(root, build, pathlib.Path(temporary)))
    print('one row each: quantity, option and reason show everywhere')
    return 0


if __name__ == '__main__':
    sys.exit(main())
