"""Files that nest without end: a clear error, and never a RecursionError."""
import pytest

from abs_hil.files import MOST_LEVELS, parse_json, parse_toml
from abs_hil.report.files import read_toml
from abs_hil.run import read_object


def nested(levels: int) -> str:
    return '{"a":' * levels + '1' + '}' * levels


def test_json_is_read_up_to_the_limit() -> None:
    value = parse_json(nested(MOST_LEVELS))
    for _ in range(MOST_LEVELS):
        value = value['a']
    assert value == 1
    assert parse_json('"text"') == 'text'
    for levels in (MOST_LEVELS + 1, 500, 100_000):
        for text in (nested(levels), '[' * levels + ']' * levels):
            with pytest.raises(ValueError, match='nested deeper than 64 levels'):
                parse_json(text)


def test_toml_is_read_up_to_the_limit() -> None:
    pytest.importorskip('tomllib')
    assert parse_toml('a.b.c = [1.5, ' + '0.25, ' * 500 + '2]')['a']['b']['c'][0] == 1.5
    with pytest.raises(ValueError, match='more than 100 parts'):
        parse_toml('[' + 'a.' * 50_000 + 'a]')
    with pytest.raises(ValueError, match='nested deeper than 64 levels'):
        parse_toml('[' + 'a.' * 80 + 'a]')
    with pytest.raises(ValueError, match='nested deeper than 64 levels'):
        parse_toml('a = ' + '[' * 100_000 + ']' * 100_000)


def test_files_of_runs(tmp_path) -> None:
    (tmp_path / 'summary.json').write_text(nested(100_000))
    (tmp_path / 'config.toml').write_text('[' + 'a.' * 50_000 + 'a]')
    with pytest.raises(ValueError, match=r'summary\.json: not valid JSON: nested deeper'):
        read_object(tmp_path / 'summary.json')
    with pytest.raises(ValueError, match=r'config\.toml: a name has more than 100 parts'):
        read_toml(tmp_path / 'config.toml')
