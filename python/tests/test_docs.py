"""The Python that docs/python.md, docs/studies.md and docs/learning.md show runs, block after block."""
import pathlib
import re

import pytest

DOCS = pathlib.Path(__file__).parents[2] / 'docs'


@pytest.mark.parametrize('page, module', [('python.md', 'pandas'), ('studies.md', 'pandas'), ('learning.md', 'gymnasium')])
def test_examples(page, module, monkeypatch):
    pytest.importorskip(module)
    monkeypatch.setenv('MPLBACKEND', 'agg')
    blocks = re.findall(r'^```python\n(.*?)^```', (DOCS / page).read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, page, 'exec'), names)
