"""Tables that scripts keep in pages, each between the lines <!-- MARK --> and <!-- end -->. Imported by these scripts."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def replaced(page, mark, table):
    """The text of docs/`page` with `table` between the lines. SystemExit where they are missing."""
    text = (ROOT / 'docs' / page).read_text(encoding='utf-8')
    marked = re.compile(rf'^(<!-- {re.escape(mark)} -->\n)(?:.*?^)?(<!-- end -->)$', re.MULTILINE | re.DOTALL)
    if not marked.search(text):
        sys.exit(f'docs/{page}: the line <!-- {mark} --> is missing, or its <!-- end -->')
    return marked.sub(lambda match: match[1] + table + match[2], text)


def write(page, mark, table):
    (ROOT / 'docs' / page).write_text(replaced(page, mark, table), encoding='utf-8')


def keep(mode, tables):
    """--write puts each table there, --check says where a page has another one. tables: (page, mark, function that makes it).
    Returns the status of the program."""
    stale = 0
    for page, mark, make in tables:
        table = make()
        if mode == '--write':
            write(page, mark, table)
        elif replaced(page, mark, table) != (ROOT / 'docs' / page).read_text(encoding='utf-8'):
            print(f'docs/{page}: the table <!-- {mark} --> is stale; {pathlib.Path(sys.argv[0]).resolve().relative_to(ROOT)} --write mends it')
            stale = 1
    return stale
