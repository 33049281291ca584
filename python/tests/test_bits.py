"""The package computes the bits of the table of runs, which every platform is held to (tests/core/run_bits.cpp)."""
import hashlib
import pathlib

import pytest

import abs_hil
from abs_hil.run import csv_bytes

TABLE = pathlib.Path(__file__).parents[2] / 'tests' / 'core' / 'run_bits.tsv'
ROWS = [line.split('\t') for line in TABLE.read_text(encoding='utf-8').splitlines()]


@pytest.mark.parametrize('checksum, words', ROWS, ids=[words for _, words in ROWS])
def test_bits(checksum, words):
    given, assignments = {}, {}
    for option, value in zip(words.split()[::2], words.split()[1::2]):
        if option == '--set':
            key, assignment = value.split('=')
            assignments[key] = assignment
        else:
            given[option.removeprefix('--')] = int(value) if option == '--seed' else value
    run = abs_hil.simulate(set=assignments, **given)
    rows = csv_bytes(run.columns, header=False)
    assert hashlib.sha256(rows).hexdigest() == checksum
