#!/usr/bin/env python3
"""usage: one_row_test.py SOURCE BUILD [FOLDER]

A quantity, an option, a reason, an end condition of phases and a figure of merit are one row each, and for quantity and
figure the line that fills it. The test adds a made-up one of each to a copy of the tree, builds the program and the Python module, and looks for
them wherever they must show: a quantity in CSV, event log, MCAP and Python. It reads a log from before the row, too, and
expects to be told what that log lacks.

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
FIGURES = 'src/analysis/braking_figures.hpp'
OPTIONS = 'include/abs_hil/control/baseline_options.hpp'
REASONS = 'include/abs_hil/rig/reason.hpp'
ENDS = 'src/experiment/end_conditions.hpp'

# The torque of the command is part of every record and no other quantity: what comes out of a log went into it by this row.
QUANTITY_ROW = ('    Quantity{"made_up_Nm", "N m", "9.9", Topic::board, Destination::both, '
                '[](auto& c) -> auto& { return c.record.command.brake_torque_Nm; }, "made-up meaning"},')
FIGURE_ROW = ('    {"made_up_s", &Metrics::made_up_s, "made-up figure", "s", 3, Better::less, true, 16, "made-up figure of merit", '
              '""},')
OPTION = 'control.relay.made_up_gain'
OPTION_ROW = ('  ABS_HIL_OPTION(double, made_up_gain, 1.5, .unit = "N m", .meaning = "made-up gain", '
              '.range = rig::between(0.25, 4));')
REASON_TEXT = 'made-up end of a run'
END_ROW = ('  ROW(made_up, "made_up", "s", rig::positive(10), "made-up time since the start", "{} s of the run are over", '
           'phase_duration_over, exact, input.time_s >= value) \\')


def add_rows(copy):
    """One line each, and for the figure its member, the line that computes it and the length of the table. Returns the
    number of the reason."""
    for name in (QUANTITIES, FIGURES, OPTIONS, REASONS, ENDS):
        assert 'made_up' not in (copy.tree / name).read_text(encoding='utf-8'), name
    copy.insert_before(QUANTITIES, 'inline constexpr std::tuple quantities{', '};', QUANTITY_ROW)
    copy.insert_before(OPTIONS, 'struct RelayOptions {', '};', OPTION_ROW)
    numbers = re.findall(r'^  ROW\(\w+, (\d+),', (copy.tree / REASONS).read_text(encoding='utf-8'), re.MULTILINE)
    number = max(map(int, numbers)) + 1
    copy.insert_before(REASONS, '#define ABS_HIL_REASONS(ROW)', '  /* the end of the rows */',
                       f'  ROW(made_up, {number}, fault, no, "{REASON_TEXT}") \\')
    lines = (copy.tree / ENDS).read_text(encoding='utf-8').split('\n')
    copy.insert_before(ENDS, '#define ABS_HIL_END_CONDITIONS(ROW)',
                       next(line for line in lines if line.startswith('  ROW(start_command,')), END_ROW)
    for name in (QUANTITIES, OPTIONS, REASONS, ENDS):
        assert copy.changed_lines(name) == (1, 0), f'{name}: {copy.changed_lines(name)} lines added and removed'
    copy.insert_before(FIGURES, 'struct FiguresOf {', '};', '  S made_up_s{rig::unknown};')
    copy.insert_before(FIGURES, 'inline constexpr std::array<Figure, ', '}};', FIGURE_ROW)
    copy.change(FIGURES, '  final_speed_m_s = sample.v_x_m_s;\n',
                '  final_speed_m_s = sample.v_x_m_s;\n  this->made_up_s = since_brake_s;\n')
    copy.change(FIGURES, 'std::array<Figure, 16> figures', 'std::array<Figure, 17> figures')
    assert copy.changed_lines(FIGURES) == (4, 1), copy.changed_lines(FIGURES)
    return number


def columns_of(path):
    with open(path, encoding='utf-8', newline='') as file:
        return list(csv.DictReader(file))


def quantity_in_files(copy, program):
    """In the CSV of a run, and by way of an event log in the CSV that `convert` makes of it."""
    run, log, converted = copy.build / 'run.csv', copy.build / 'run.lcmlog', copy.build / 'converted.csv'
    copy.run(program, '--fast', '--no-lcm', '--csv', run, '--log', log)
    columns = run.read_text().split('\n', 1)[0].split(',')
    # The phase's name and the controller's own signals follow the table's columns.
    assert columns[columns.index('wheels_apart') + 1] == 'made_up_Nm', columns
    rows = columns_of(run)
    values = [row['made_up_Nm'] for row in rows]
    assert len(set(values)) > 100, values[:10]
    for row in rows:  # it is the torque of the command: 0 without one, near the reference with one
        assert abs(float(row['made_up_Nm']) - float(row['brake_torque_ref_Nm'])) < 1.0, row
    converted.unlink(missing_ok=True)
    copy.run(program, 'convert', log, converted)
    assert [row['made_up_Nm'] for row in columns_of(converted)] == values


def quantity_in_an_older_log(copy, program, older):
    """A log from before the row: it is read, and what it lacks is said."""
    converted = copy.build / 'older.csv'
    converted.unlink(missing_ok=True)
    said = subprocess.run([program, 'convert', older, converted], env=copy.environment, check=True, capture_output=True,
                          text=True)
    assert 'lacks made_up_Nm' in said.stdout, said.stdout
    assert {row['made_up_Nm'] for row in columns_of(converted)} == {'NaN'}
    said = subprocess.run([program, 'replay', older, '--check'], env=copy.environment, capture_output=True, text=True)
    assert said.returncode == 0 and 'lacks made_up_Nm' in said.stderr, said.stdout + said.stderr


def figure_in_files(copy, program):
    """In the summary, in a comparison and in a study's results."""
    summary, table = copy.build / 'run.json', copy.build / 'compare.csv'
    copy.run(program, '--fast', '--no-lcm', '--summary', summary)
    figures = json.loads(summary.read_text())
    assert figures['made_up_s'] > 1.0, figures['made_up_s']
    copy.run(program, 'compare', '--controllers', 'adaptive,locked', '--repeat', '2', '--csv', table)
    assert [row for row in columns_of(table) if 'made_up_s' in row.values()], table.read_text()


def option_in_lists(copy, program):
    lines = [line.split() for line in copy.run(program, 'list', '--keys').splitlines()]
    wanted = [OPTION, '1.5', '[0.25,', '4]', 'N', 'm;', 'made-up', 'gain']  # its class of safety follows
    assert any(line[:len(wanted)] == wanted for line in lines), [line for line in lines if line[:1] == [OPTION]]
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


def end_condition_in_experiments(copy, program):
    """In the schema and in words; a phase ends by it; a value out of range and a misspelt name are refused."""
    until = json.loads(copy.run(program, 'validate', '--schema'))['$defs']['until']['properties']
    assert until['made_up_s']['anyOf'][0]['maximum'] == 10, until['made_up_s']
    script = copy.build / 'made_up_end.toml'
    events = copy.build / 'made_up_end.csv'
    for until, status, words in (('made_up = "250 ms"', 0, '0.25 s of the run are over'),
                                 ('made_up_s = 11', 2, 'made_up_s = 11 is not valid; give a number in (0, 10] s'),
                                 ('maed_up_s = 1', 2, 'the nearest known key is "made_up_s"')):
        script.write_text(f'[[phase]]\nname = "a"\nuntil = {{ {until} }}\nat_most_s = 1\n')
        said = copy.run(program, 'validate', script, status=status)
        assert words in said, said
    script.write_text('[[phase]]\nname = "a"\nuntil = { made_up_s = 0.25 }\nat_most_s = 1\n')
    copy.run(program, '--fast', '--no-lcm', '--experiment', script, '--csv', events)
    times = [float(row['time_s']) for row in columns_of(events)]
    assert abs(times[-1] - 0.25) < 0.01, times[-1]


def tables_of_the_program(copy, program, number):
    row = json.loads(copy.run(program, 'list', '--quantities', '--json'))[-1]
    assert (row['name'], row['since'], row['meaning']) == ('made_up_Nm', '9.9', 'made-up meaning')
    columns = (copy.build / 'run.csv').read_text().split('\n', 1)[0].split(',')
    assert columns[row['csv_column'] - 1] == 'made_up_Nm', row
    assert 'made_up_Nm' in copy.run(program, 'list', '--quantities')
    rows = json.loads(copy.run(program, 'list', '--reasons', '--json'))
    made_up = {'number': number, 'name': 'made_up', 'kind': 'fault', 'found_again': 'no', 'text': REASON_TEXT,
               'quantity': '', 'unit': '', 'bound': ''}
    assert made_up in rows
    assert REASON_TEXT in copy.run(program, 'list', '--reasons')


def tables_of_the_docs(copy):
    """The documentation's files lack the rows, are found out, and get them."""
    script = ('scripts/docs_tables.py',)
    said = copy.run(sys.executable, *script, '--check', copy.build, status=1)
    copy.run(sys.executable, *script, '--write', copy.build)
    copy.run(sys.executable, *script, '--check', copy.build)
    for name in ('keys', 'quantities', 'reasons'):
        file = f'docs/reference/{name}.csv'
        assert file in said, said
        assert copy.changed_lines(file) == (1, 0), copy.changed_lines(file)


def tables_of_python(copy, number):
    """Tables, the rows of a log, a figure of merit and an MCAP file, in Python."""
    code = ('import abs_hil, sys\n'
            'print(abs_hil.QUANTITIES["made_up_Nm"]["meaning"])\n'
            f'print(abs_hil.REASONS[{number}]["text"])\n'
            'print(abs_hil.figures()["made_up_s"].heading)\n'
            'log = abs_hil.load(sys.argv[1])\n'
            'print(log["made_up_Nm"].max() > 1.0, list(log.signals)[:1])\n'
            'from abs_hil.interchange import recorded\n'
            'recorded.to_mcap(recorded.read(sys.argv[1]), sys.argv[2])\n')
    environment = {**copy.environment, 'PYTHONPATH': str(copy.build / 'share' / 'abs_hil' / 'python')}
    mcap = copy.build / 'run.mcap'
    own = copy.root / 'build' / 'python' / 'bin' / 'python'  # it has the modules that the package needs
    said = subprocess.run([own, '-c', code, copy.build / 'run.lcmlog', mcap], env=environment, check=True,
                          capture_output=True, text=True)
    assert said.stdout.splitlines() == ['made-up meaning', REASON_TEXT, 'made-up figure / s', "True ['I_m']"], said.stdout
    assert b'made_up_nm  # made_up_Nm: [N m] made-up meaning' in mcap.read_bytes()


def test(copy, built):
    older = copy.build / 'older.lcmlog'
    copy.build.mkdir(parents=True, exist_ok=True)
    copy.run(built / 'bin' / 'abs_hil', '--fast', '--no-lcm', '--log', older)
    number = add_rows(copy)
    copy.configure(python=True)
    copy.make('abs_hil_executable', 'abs_hil_python')
    program = copy.build / 'bin' / 'abs_hil'
    quantity_in_files(copy, program)
    quantity_in_an_older_log(copy, program, older)
    figure_in_files(copy, program)
    option_in_lists(copy, program)
    option_takes_values(copy, program)
    end_condition_in_experiments(copy, program)
    tables_of_the_program(copy, program, number)
    tables_of_the_docs(copy)
    tables_of_python(copy, number)


def main():
    root, build, *folder = (pathlib.Path(path).resolve() for path in sys.argv[1:])
    if folder:
        test(ScratchCopy(root, build, folder[0]), build)
    else:
        with tempfile.TemporaryDirectory(prefix='abs_hil_one_row.') as temporary:
            test(ScratchCopy(root, build, pathlib.Path(temporary)), build)
    print('one row each: quantity, figure of merit, option, reason and end condition show everywhere')
    return 0


if __name__ == '__main__':
    sys.exit(main())
