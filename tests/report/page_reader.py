"""Reads a report's page like a browser: figures with their curves, tables, elements, the page's text."""
import base64
import gzip
import html.parser
import json
import struct


def unpacked(text):
    """The bytes of a compressed script element."""
    return gzip.decompress(base64.b64decode(text))


class PageReader(html.parser.HTMLParser):
    """figures[id] = list of curves: run, quantity, stated number of points, drawn points, panel (1, 2, ...), name."""

    def __init__(self, page):
        super().__init__()
        self.figures = {}
        self.elements = {}
        self.tables = {}
        self.plots = {}
        self.scripts = []
        self.alternatives = {}
        self.headings = {}
        self.policy = ''
        self._table = None
        self._in_cell = False
        self._heading = None
        self._script = None
        self.feed(page)
        self._read_plots()

    def _read_plots(self):
        data = unpacked(self.scripts[0][1])
        begin = 4 + struct.unpack_from('<I', data)[0]
        text = json.loads(data[4:begin])
        self.dark = text['dark']

        def numbers(array):
            return struct.unpack_from(f'<{array["size"]}{"f" if array["floats"] == 32 else "d"}', data, begin + array['at'])

        for plot in text['plots']:
            self.plots[plot['id']] = plot
            for trace in plot['data']:
                meta = trace['meta']
                if meta is None or meta['quantity'] == 'phase':  # an empty panel's, or a colour's in the legend
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
            self._script, self._more = attrs.get('type', ''), False
        if tag == 'div' and 'aria-label' in attrs:
            self.alternatives[attrs['id'].removeprefix('plot-')] = attrs['aria-label']
        if tag == 'b':
            self._heading = ''
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
        if tag == 'b':
            self.headings[list(self.figures)[-1]], self._heading = self._heading, None
        if tag in ('td', 'th'):
            self._in_cell = False

    def handle_data(self, data):
        if self._script is not None:
            if self.scripts and self.scripts[-1][0] == self._script and self._script == 'application/gzip' and self._more:
                self.scripts[-1] = (self._script, self.scripts[-1][1] + data)
            else:
                self.scripts.append((self._script, data))
            self._more = True
        if self._heading is not None:
            self._heading += data
        if self._in_cell:
            self._table[-1][-1] += data

    def curve(self, figure, panel, number):
        """Curve number `number` of panel a, b, ... of a figure."""
        inside = [curve for curve in self.figures[figure] if curve['panel'] == 1 + 'abcdef'.index(panel)]
        return inside[number - 1]

    def cell(self, table, row, column=1):
        return next(line[column] for line in self.tables[table] if line[0] == row)
