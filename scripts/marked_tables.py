"""Tables that scripts keep: short ones in pages, each between the lines <!-- MARK --> and <!-- end -->; long ones in CSV files of
docs/reference. Imported by these scripts."""
import csv
import io
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


def csv_text(head, rows):
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([head, *rows])
    return text.getvalue()


def write(page, mark, table):
    (ROOT / 'docs' / page).write_text(replaced(page, mark, table), encoding='utf-8')


def keep(mode, tables):
    """--write puts each table there, --check says where a page has another one. tables: (page, mark, function that makes it);
    without a mark the table is the whole file. Returns the status of the program."""
    stale = 0
    for page, mark, make in tables:
        path, table = ROOT / 'docs' / page, make()
        wanted = replaced(page, mark, table) if mark else table
        if mode == '--write':
            path.write_text(wanted, encoding='utf-8')
        elif not path.exists() or path.read_text(encoding='utf-8') != wanted:
            print(f'docs/{page}: {f"the table <!-- {mark} -->" if mark else "this file"} is stale; '
                  f'{pathlib.Path(sys.argv[0]).resolve().relative_to(ROOT)} --write mends it')
            stale = 1
    return stale
