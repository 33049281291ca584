"""Reads a report's page like a browser: figures with their curves, tables, the page's text."""
import html.parser
import re


class PageReader(html.parser.HTMLParser):
    """figures[id] = list of curves: id, run, quantity, stated number of points, drawn points."""

    def __init__(self, page):
        super().__init__()
        self.figures = {}
        self.elements = {}
        self.tables = {}
        self._curve_depth = None
        self._depth = 0
        self._figure = None
        self._table = None
        self._in_cell = False
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.elements[tag] = self.elements.get(tag, 0) + 1
        if tag == 'figure':
            self._figure = self.figures.setdefault(attrs['id'].removeprefix('figure-'), [])
        if tag == 'g':
            self._depth += 1
            if attrs.get('class') == 'curve':
                self._curve_depth = self._depth
                self._figure.append({'id': attrs['id'], 'run': int(attrs['data-run']),
                                     'quantity': attrs['data-quantity'], 'said': int(attrs['data-points']),
                                     'drawn': 0, 'xy': []})
        if self._curve_depth and tag == 'path':
            found = re.findall(r'[ML]\s*(-?[\d.]+),(-?[\d.]+)', attrs['d'])
            self._figure[-1]['drawn'] += len(found)
            self._figure[-1]['xy'] += [(float(x), float(y)) for x, y in found]
        if self._curve_depth and tag == 'use':
            self._figure[-1]['drawn'] += 1
        if tag == 'table':
            self._table = self.tables.setdefault(attrs['id'], [])
        if tag == 'tr':
            self._table.append([])
        if tag in ('td', 'th'):
            self._table[-1].append('')
            self._in_cell = True

    def handle_endtag(self, tag):
        if tag == 'g':
            if self._curve_depth == self._depth:
                self._curve_depth = None
            self._depth -= 1
        if tag in ('td', 'th'):
            self._in_cell = False

    def handle_data(self, data):
        if self._in_cell:
            self._table[-1][-1] += data

    def curve(self, figure, panel, number):
        return next(curve for curve in self.figures[figure] if curve['id'] == f'{figure}_{number}{panel}')

    def cell(self, table, row, column=1):
        return next(line[column] for line in self.tables[table] if line[0] == row)
