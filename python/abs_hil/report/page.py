"""A report as one HTML page that needs no network: tables, plotly.js, and the curves as data."""
from __future__ import annotations

import base64
import hashlib
import importlib.util
import json
import pathlib
from dataclasses import dataclass, field
from typing import Any

from .model import Figure
from .plots import plot
from .tables import Table

_FOLDER = pathlib.Path(__file__).parent
#: marks a file as a page of abs_report
PAGE_MARK = '<meta name="generator" content="abs_report'
MOST_OPEN_ROWS = 12


class Unavailable(RuntimeError):
    """A part that this computer lacks; the message says how to install it."""


@dataclass
class SeriesPart:
    name: str
    figure: Figure
    groups: Table
    table: Table
    open: bool


@dataclass
class PaperPart:
    claims: Table
    statements: dict[str, tuple[str, str]]


@dataclass
class Contents:
    title: str
    version: str
    lead: str
    runs: int
    metrics: Table
    shared: str
    differences: Table
    timing: Table
    events: Table
    events_left_out: int
    environment: Table
    notes: list[str]
    figures: list[Figure] = field(default_factory=list)
    timing_figure: Figure | None = None
    series: list[SeriesPart] = field(default_factory=list)
    paper: PaperPart | None = None


def plotly_js() -> str:
    """The source of plotly.js: of the Python package plotly, or the copy that a Debian package brings."""
    places = [_FOLDER / 'plotly.min.js']
    found = importlib.util.find_spec('plotly')
    if found is not None and found.submodule_search_locations:
        places.insert(0, pathlib.Path(found.submodule_search_locations[0]) / 'package_data' / 'plotly.min.js')
    for place in places:
        if place.exists():
            return place.read_text(encoding='utf-8')
    raise Unavailable('plotly.js, which the page shows its figures with, is missing; install it: pip install plotly, or '
                      'scripts/setup_python.sh python-packages.txt in the source folder')


def _hash(script: str) -> str:
    return "'sha256-" + base64.b64encode(hashlib.sha256(script.encode('utf-8')).digest()).decode() + "'"


def _as_script_data(data: Any) -> str:
    """JSON that cannot end its script element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(',', ':'))
    return text.replace('<', '\\u003c').replace('\u2028', '\\u2028').replace('\u2029', '\\u2029')


def render(template: str, drawn: list[Figure], folder: pathlib.Path = _FOLDER, **context: Any) -> str:
    """A page from a template of `folder`, with these figures as data and the policy that only its own scripts run."""
    import jinja2
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined,
                                     loader=jinja2.FileSystemLoader([folder, _FOLDER]))
    plotly = plotly_js().replace('</script', '<\\/script')
    js = (_FOLDER / 'page.js').read_text(encoding='utf-8')
    # No script but these two runs, and nothing is fetched: a run's files cannot inject active content.
    policy = (f"default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; "
              f'script-src {_hash(plotly)} {_hash(js)}')
    return environment.get_template(template).render(
        **context, plots=_as_script_data([plot(figure) for figure in drawn]), plotly=plotly, js=js, policy=policy,
        css=(_FOLDER / 'page.css').read_text(encoding='utf-8')) + '\n'


def view(figure: Figure) -> dict[str, Any]:
    """What a template shows of a figure beside its plot."""
    return {'id': figure.id, 'heading': figure.heading, 'caption': figure.caption, 'height': plot(figure)['height']}


def page(contents: Contents) -> str:
    shown = [part.figure for part in contents.series]
    shown += [figure for figure in contents.figures
              if contents.paper is None or figure.id in contents.paper.statements]
    if contents.timing_figure is not None and contents.paper is None:
        shown.append(contents.timing_figure)
    names = {figure.id for figure in shown}
    seen = [figure for figure in contents.figures if figure.id in names]
    timing = contents.timing_figure
    views: dict[str, Any] = {
        'series': [{**vars(part), 'figure': view(part.figure)} for part in contents.series],
        'figures': [view(figure) for figure in seen],
        'timing_figure': view(timing) if timing is not None and timing.id in names else None,
        'many': contents.runs > MOST_OPEN_ROWS}
    return render('page.html.j2', shown, **{**vars(contents), **views})
