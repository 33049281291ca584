"""abs_hil lab: a page that simulates the rig and its controllers in the browser, without a server (docs/lab.md)."""
import argparse
import pathlib
import sys
from collections.abc import Sequence

from ..files import write_text
from ..report.page import Unavailable
from .exercise import find, known, read
from .page import page


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='abs_hil lab', allow_abbrev=False, description=__doc__.split(' (docs')[0] + '.')
    parser.add_argument('--out', metavar='FILE', type=pathlib.Path, default=pathlib.Path('lab.html'), help='the page (lab.html)')
    parser.add_argument('--exercise', metavar='FILE',
                        help='a TOML file that says what the page asks, hides and offers; or one that is ready: '
                             + ', '.join(path.stem for path in known()))
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    given = _parser().parse_args(arguments)
    try:
        text = page(None if given.exercise is None else read(find(given.exercise)))
        write_text(given.out, text)
    except (ValueError, Unavailable, ImportError) as error:
        print(f'abs_hil lab: {error}', file=sys.stderr)
        return 2
    print(f'{given.out}: {len(text.encode()) / 1e6:.1f} MB; open it in a browser')
    return 0


if __name__ == '__main__':
    sys.exit(main())
