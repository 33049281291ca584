"""Rows of a run's CSV: as they were written, or refused with file and line."""
import gzip
import random

import numpy as np
import pytest

from abs_hil.rows import CONTRACT, read_rows

HEADER = ','.join(CONTRACT) + '\n'


def row(time, phase='brake'):
    return f'{time},{phase},1,2,3,4,5,6,7,8,9,10,11,12,1,NaN,14,15,-1.5e-3'


def read(tmp_path, text):
    path = tmp_path / 'run.csv'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_rows(path)


def refusal(tmp_path, text):
    with pytest.raises(ValueError) as refused:
        read(tmp_path, text)
    return str(refused.value).replace(str(tmp_path / 'run.csv'), 'FILE')


def test_the_contract_is_the_first_versions_columns():
    assert len(CONTRACT) == 19 and CONTRACT[:2] == ('time_s', 'phase') and CONTRACT[-1] == 'slip_velocity_error_m_s'


def test_rows_are_read_as_they_were_written_with_any_line_ends_and_further_columns(tmp_path):
    found = read(tmp_path, HEADER.strip() + ',extra\r\n' + row('0.25') + ',7\r\n' + row('0.5', 'hold') + ',8\r\n')
    columns = found.columns
    assert columns['time_s'].tolist() == [0.25, 0.5]
    assert columns['phase'].tolist() == ['brake', 'hold']
    assert np.isnan(columns['theta_N']).all()
    assert columns['slip_velocity_error_m_s'].tolist() == [-1.5e-3, -1.5e-3]
    assert columns['extra'].tolist() == [7.0, 8.0]
    assert not found.truncated
    assert list(read(tmp_path, b'\xef\xbb\xbf' + (HEADER + row('1') + '\n').encode()).columns) == list(CONTRACT)


def test_numbers_read_back_bit_for_bit(tmp_path):
    generator = random.Random(3)
    values = [5e-324, -0.0, 1.7976931348623157e308, 0.1 + 0.2, *(generator.gauss(0, 10) ** 7 for _ in range(3000))]
    text = HEADER + ''.join(row(number).replace('-1.5e-3', repr(value)) + '\n' for number, value in enumerate(values))
    back = read(tmp_path, text).columns['slip_velocity_error_m_s']
    assert back.tobytes() == np.array(values).tobytes()


@pytest.mark.parametrize('cut', [row('2'), '2,bra', '2'])
def test_a_last_line_without_line_end_is_no_row_even_if_it_is_complete(tmp_path, cut):
    found = read(tmp_path, HEADER + row('1') + '\n' + cut)
    assert found.columns['time_s'].tolist() == [1.0] and found.truncated


def test_a_file_that_is_no_run_is_refused_with_file_and_line(tmp_path):
    assert refusal(tmp_path, '') == 'FILE:1: the file is empty: the run wrote nothing'
    assert refusal(tmp_path, 'time_s,pha') == ('FILE:1: the file ends within its first line: the recording stopped before '
                                               'the first row')
    assert refusal(tmp_path, 'time_s,phase\n').startswith('FILE:1: the header lacks omega1_rad_s, ')
    assert refusal(tmp_path, HEADER) == 'FILE:1: no rows after the header: the file holds no data of the run'
    assert 'FILE:2: the only row is incomplete' in refusal(tmp_path, HEADER + row('1'))
    good = row('1') + '\n'
    assert refusal(tmp_path, HEADER + good + row('0.5') + '\n') == 'FILE:3: time_s decreases from 1 to 0.5'
    assert refusal(tmp_path, HEADER + row('x') + '\n').startswith('FILE:2: time_s: "x" is not a number')
    assert refusal(tmp_path, HEADER + good + row('') + '\n').startswith('FILE:3: time_s: "" is not a number')
    assert refusal(tmp_path, HEADER + row('NaN') + '\n') == 'FILE:2: time_s is not a finite number'
    for time in ('-5', '1e300', '1e12'):
        assert refusal(tmp_path, HEADER + row(time) + '\n').startswith(f'FILE:2: time_s = {float(time):g} is no time of a run')
    assert refusal(tmp_path, HEADER + good + '1,brake,3\n') == ('FILE:3: the row has 3 fields instead of 19 and ends before '
                                                               'omega2_rad_s')
    assert refusal(tmp_path, HEADER + row('1') + ',9\n') == 'FILE:2: the row has more than the header\'s 19 fields'
    assert refusal(tmp_path, HEADER + good + '\n\n' + row('x') + '\n').startswith('FILE:5: time_s: "x" is not a number')
    assert refusal(tmp_path, HEADER.strip() + ',slip\n' + row('1') + ',1\n') == 'FILE:1: the header has the column slip twice'
    with pytest.raises(ValueError, match='cannot read .*give a run\'s CSV file or folder'):
        read_rows(tmp_path / 'none.csv')


def test_any_bytes_are_refused_or_read_with_a_number_for_every_line_and_times_in_order(tmp_path):
    generator = random.Random(1)
    whole = (HEADER + ''.join(row(number) + '\n' for number in range(20))).encode()
    read_anyway = 0
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(generator.randrange(1, 4)):
            place = generator.randrange(len(HEADER) if generator.random() < 0.9 else 0, len(data))
            data[place:place + generator.randrange(2)] = generator.choice([b'', b',', b'\n', b'7', b'"', b'\xff', b'\0', b'\r'])
        try:
            found = read(tmp_path, bytes(data))
        except ValueError as error:
            assert str(error)
            continue
        read_anyway += 1
        rows = sum(bool(line.strip(b' \t,;"\r')) for line in bytes(data).split(b'\n')) - 1
        assert all(len(values) == rows for values in found.columns.values())
        assert (np.diff(found.columns['time_s']) >= 0).all()
    assert 20 < read_anyway < 380


def test_texts_are_made_fit_to_show(tmp_path):
    text = (HEADER + row('1', 'b\x1b[2J') + '\n').encode() + (row('2', 'x' * 99) + '\n').encode()
    phases = read(tmp_path, text.replace(b'b\x1b', b'\xff\x1b')).columns['phase'].tolist()
    assert phases == ['\ufffd\ufffd[2J', 'x' * 40 + '\u2026']


PLAIN = HEADER.strip() + ',I_m\n' + ''.join(f'{row(number / 4)},{number * 0.1!r}\n' for number in range(5)).replace('14,', 'NaN,')


def spreadsheet(separator, decimal):
    """What a spreadsheet saves: CRLF, quoted texts and, where the decimal mark is the separator, numbers."""
    lines = []
    for line in PLAIN.strip().split('\n'):
        fields = [one.replace('.', decimal) if one[0] in '-0123456789' else f'"{one}"' for one in line.split(',')]
        lines.append(separator.join(f'"{one}"' if separator in one else one for one in fields))
    return '\r\n'.join(lines) + '\r\n'


@pytest.mark.parametrize('data', [
    b'\xef\xbb\xbf' + spreadsheet(',', '.').encode(), b'\xef\xbb\xbf' + spreadsheet(';', ',').encode(),
    spreadsheet('\t', ',').encode(),
    spreadsheet(',', ',').encode(), spreadsheet(';', '.').encode('utf-16'), ('\ufeff' + spreadsheet(';', ',')).encode('utf-16-be'),
    gzip.compress(PLAIN.encode()), PLAIN.replace('\n', '\r').encode(), b'sep=;\r\n' + spreadsheet(';', ',').encode(),
    b'# saved by hand, \xe4\n\n' + PLAIN.replace(',', ' , ').encode() + b'\n\n', PLAIN.replace('NaN', '').encode(),
    PLAIN.replace('NaN', 'nan').encode(), (spreadsheet(';', ',').replace('\r\n', ';;;\r\n') + ';' * 22 + '\r\n').encode(),
    # with pandas's index
    '\n'.join(f'{number or ""},{line}' for number, line in enumerate(PLAIN.split('\n')) if line).encode() + b'\n'])
def test_what_people_and_spreadsheets_make_of_a_csv_reads_the_same(tmp_path, data):
    plain, found = read(tmp_path, PLAIN), read(tmp_path, data)
    assert not found.truncated and found.notes == []
    for name, values in plain.columns.items():
        assert found.columns[name].dtype == values.dtype
        assert list(found.columns[name]) == list(values) or np.array_equal(found.columns[name], values, equal_nan=True), name


def test_columns_of_texts_are_left_out_and_damaged_numbers_are_not(tmp_path):
    text = PLAIN.replace('I_m', 'note,I_m').replace('e-3,', 'e-3,good,')
    found = read(tmp_path, text)
    assert 'note' not in found.columns and 'I_m' in found.columns and 'column note of ' in found.notes[0]
    assert refusal(tmp_path, text.replace('good', '5', 1)).startswith('FILE:3: note: "good" is not a number')
    assert refusal(tmp_path, PLAIN.replace('0.1', 'x')).startswith('FILE:3: I_m: "x" is not a number')


def test_a_spreadsheet_s_thousands_are_refused_with_their_line(tmp_path):
    text = spreadsheet(';', ',').replace('0,25', '1.000,25')
    assert refusal(tmp_path, '\ufeff# x\r\n' + text).startswith('FILE:4: time_s: "1.000,25" is not a number')


def test_a_table_of_several_runs_may_begin_again_in_time(tmp_path):
    lines = (HEADER + row('1') + '\n' + row('2') + '\n' + row('0.5') + '\n').split('\n')
    named = [f'{name},{line}' for name, line in zip(('run', 'a', 'a', 'b'), lines)]
    assert read(tmp_path, '\n'.join(named) + '\n').columns['run'].tolist() == ['a', 'a', 'b']
    named[3] = named[3].replace('b,', 'a,', 1)
    assert refusal(tmp_path, '\n'.join(named) + '\n') == 'FILE:4: time_s decreases from 2 to 0.5'
