"""A report as one HTML page that needs no network: tables, plotly.js, and the curves as data."""
import base64
import gzip
import hashlib
import importlib.util
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..places import Unavailable, how_to_install
from .model import Figure
from .plots import packed, plot
from .text import significant

_FOLDER = pathlib.Path(__file__).parent
#: marks a file as a page of abs_report
PAGE_MARK = '<meta name="generator" content="abs_report'
MOST_OPEN_ROWS = 12
MOST_TOLD = 12  # curves of a panel in its text alternative
MOST_BESIDE = 3  # runs whose figures of merit stand beside the first figure


def plotly_js() -> str:
    """The source of plotly.js: of the Python package plotly, or the copy that a Debian package brings."""
    found = importlib.util.find_spec('plotly')
    folders = (found.submodule_search_locations if found is not None else None) or []
    for folder in (*(pathlib.Path(one) / 'package_data' for one in folders), _FOLDER):
        if (place := folder / 'plotly.min.js').exists():
            return place.read_text(encoding='utf-8')
    raise Unavailable(f'plotly.js, which the page shows its figures with, is missing; install it: {how_to_install("plotly")}')


def standalone(template: str, folders: list[pathlib.Path], data: dict[str, bytes], scripts: list[str], css: str, *,
               started: Sequence[str] = (), more: str = '', **context: Any) -> str:
    """A page that fetches nothing. data: by the id under which the page's scripts find it; scripts: those that run, and
    `started` those that they start; no other does, so a run's files cannot inject active content."""
    import jinja2
    from markupsafe import Markup
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined,
                                     loader=jinja2.FileSystemLoader(folders))
    hashes = ' '.join("'sha256-" + base64.b64encode(hashlib.sha256(script.encode('utf-8')).digest()).decode() + "'"
                      for script in (*started, *scripts))
    policy = ("default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; "
              f'script-src {hashes}{more}')
    packs = {name: base64.b64encode(gzip.compress(content, 9, mtime=0)).decode() for name, content in data.items()}
    parts = [f'<script type="application/gzip" id="{name}">{pack}</script>' for name, pack in packs.items()]
    parts += [f'<script>{script}</script>' for script in scripts]
    return environment.get_template(template).render(**context, policy=policy, css=Markup(css),
                                                     scripts=Markup('\n'.join(parts))) + '\n'


def render(template: str, drawn: list[Figure] | list[dict[str, Any]], folder: pathlib.Path = _FOLDER, **context: Any) -> str:
    """A page from a template of `folder`, with these figures as data."""
    plotly = plotly_js()
    plots = [figure if isinstance(figure, dict) else plot(figure) for figure in drawn]
    return standalone(template, [folder, _FOLDER], {'plots': packed(plots), 'plotly': plotly.encode()},
                      [(_FOLDER / 'page.js').read_text(encoding='utf-8')], (_FOLDER / 'page.css').read_text(encoding='utf-8'),
                      started=[plotly], **context)


def _alternative(figure: Figure) -> str:
    """What a reader without the picture is told: each curve's quantity and range."""
    parts = []
    for panel in figure.panels:
        for curve in panel.curves[:MOST_TOLD]:
            y = curve.y[np.isfinite(curve.y)]
            if len(y):
                low, high = significant(float(y.min()), 3), significant(float(y.max()), 3)
                name = ', '.join(filter(None, dict.fromkeys([curve.title or panel.title or curve.quantity, curve.legend])))
                parts.append(f'{name}: {low} to {high} {panel.unit}'.rstrip())
    return f'{figure.heading}. {"; ".join(parts)}.'


def view(figure: Figure, heading: str = '') -> dict[str, Any]:
    """What a template shows of a figure beside its plot."""
    return {'id': figure.id, 'heading': heading or figure.heading, 'caption': figure.caption, 'height': plot(figure)['height'],
            'alternative': _alternative(figure)}


def page(figures: list[Figure], series: list[dict[str, Any]], timing_figure: Figure | None, paper: dict[str, Any] | None,
         runs: int, **parts: Any) -> str:
    """The page of runs. series: name, figure and tables of each; paper: claims, and a Pair for each figure of merit; parts:
    texts and tables, by the template's names."""
    if paper is not None:
        shown = [figure for figure in figures if figure.paper]
    else:
        shown = [figures[0], *(part['figure'] for part in series), *figures[1:], *([timing_figure] if timing_figure else [])]
    views = {}
    for number, figure in enumerate(shown, 1):
        of_paper = f'the paper’s figure {figure.paper}'
        heading = f'Figure {number}: {figure.heading}' + (f' ({of_paper})' if figure.paper else '')
        views[figure.id] = view(figure, heading if paper is None else f'{of_paper.capitalize()}: {figure.heading}')
    return render('page.html.j2', shown, **parts, paper=paper, runs=runs, many=runs > MOST_OPEN_ROWS, beside=runs <= MOST_BESIDE,
                  series=[{**part, 'figure': views.get(part['figure'].id)} for part in series],
                  timing_figure=views.get('timing'), figures=[views[figure.id] for figure in figures if figure.id in views])
