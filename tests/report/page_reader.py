"""Reads a report's page like a browser: figures with their curves, tables, elements, the page's text."""
import array
import base64
import html.parser
import json
import sys


def numbers(packed):
    """The values of packed little-endian floats."""
    values = array.array({'f4': 'f', 'f8': 'd'}[packed['type']], base64.b64decode(packed['data']))
    if sys.byteorder == 'big':
        values.byteswap()
    return list(values)


class PageReader(html.parser.HTMLParser):
    """figures[id] = list of curves: run, quantity, stated number of points, drawn points, panel (1, 2, ...), name."""

    def __init__(self, page):
        super().__init__()
        self.figures = {}
        self.elements = {}
        self.tables = {}
        self.plots = {}
        self.scripts = []
        self.policy = ''
        self._table = None
        self._in_cell = False
        self._script = None
        self.feed(page)
        self._read_plots()

    def _read_plots(self):
        for plot in json.loads(next(text for kind, text in self.scripts if kind == 'application/json')):
            self.plots[plot['id']] = plot
            for trace in plot['data']:
                meta = trace['meta']
                if meta is None:  # an empty panel's
                    continue
                xy = [(x, y) for x, y in zip(numbers(trace['x']), numbers(trace['y'])) if y == y]
                self.figures[plot['id']].append({'run': meta['run'], 'quantity': meta['quantity'], 'said': meta['points'],
                                                 'drawn': len(xy), 'xy': xy, 'panel': int(trace['xaxis'][1:]),
                                                 'name': trace['name'], 'in_legend': trace['showlegend']})

    def texts(self, figure):
        """Names that stand in a figure: marks, phases."""
        return [note['text'] for note in self.plots[figure]['layout']['annotations']]

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.elements[tag] = self.elements.get(tag, 0) + 1
        if tag == 'figure':
            self.figures[attrs['id'].removeprefix('figure-')] = []
        if tag == 'meta' and attrs.get('http-equiv') == 'Content-Security-Policy':
            self.policy = attrs['content']
        if tag == 'script':
            self._script = attrs.get('type', '')
        if tag == 'table':
            self._table = self.tables.setdefault(attrs['id'], [])
        if tag == 'tr':
            self._table.append([])
        if tag in ('td', 'th'):
            self._table[-1].append('')
            self._in_cell = True

    def handle_endtag(self, tag):
        if tag == 'script':
            self._script = None
        if tag in ('td', 'th'):
            self._in_cell = False

    def handle_data(self, data):
        if self._script is not None:
            if self.scripts and self.scripts[-1][0] == self._script and self._script == 'application/json':
                self.scripts[-1] = (self._script, self.scripts[-1][1] + data)
            else:
                self.scripts.append((self._script, data))
        if self._in_cell:
            self._table[-1][-1] += data

    def curve(self, figure, panel, number):
        """Curve number `number` of panel a, b, ... of a figure."""
        inside = [curve for curve in self.figures[figure] if curve['panel'] == 1 + 'abcdef'.index(panel)]
        return inside[number - 1]

    def cell(self, table, row, column=1):
        return next(line[column] for line in self.tables[table] if line[0] == row)
