#!/usr/bin/env python3
"""usage: page_names.py ROOT PROGRAM | --self-test

Checks README.md, CONTRIBUTING.md and the pages in docs: what they name must exist. Between backticks, outside of fences,
  - `room::Name`, `CamelCase`, `snake_case` and `call()` are names of code: a source must contain them, that of `room::Name`
    the scope `room` too;
  - `plant.x`, `control.x.y` and so on are configuration keys: `abs_hil list --keys` must know them;
  - `folder/file` and `file.hpp` are files of the tree.
Words with a place holder (capitals, *, {, <, …, `plant.x`) are left out. unchecked_names.txt lists what is named although no
source contains it, with the reason; an entry that no page needs is an error. Links must lead to files, and docs/index.md, or a
page that it leads to, must lead to every page. All pages together have at most WORDS_AT_MOST words, as `wc -w` counts. Outside
of fences no two blank lines follow each other: they are where a sentence was cut.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

#: of all pages together. Say each thing once; long tables are CSV files of docs/reference.
WORDS_AT_MOST = 60_000
FOLDERS = ('src', 'extras', 'include', 'apps', 'python', 'tests', 'research', 'scripts', 'lcmtypes', 'firmware', 'examples', 'cmake',
           'packaging', 'completion', 'config', 'bench', '.ci')
FILES = ('CMakeLists.txt', 'CMakePresets.json', 'pyproject.toml')
TOP = (*FOLDERS, 'docs', 'third_party')
SPAN = re.compile(r'(?<!`)`([^`\n]+)`(?!`)')
LINK = re.compile(r'\]\(([^)\s]+)\)')
CODE = re.compile(r'^[A-Za-z_]\w*(?:::~?\w+)*(?:\(\))?$')
FILE = re.compile(r'^[\w.-]+(?:/[\w.-]+)*/?$')
DATA = re.compile(r'^(toml|csv|json|fmu|lcmlog|mcap|parquet)$')
SCOPE = re.compile(r'\b(?:namespace|class|struct|enum class|enum|concept|using)\s+(?:\[\[\w+\]\]\s+)?([\w:]+)')
#: pages that record an older revision; its files have other names
RECORDS = ('quality.md',)
#: names of tests that CMake puts together: foreach(suite ...) add_test(NAME vm_${suite} ...)
PUT_TOGETHER = re.compile(r'(\w+_)\$\{')
ENDINGS = ('.hpp', '.cpp', '.h', '.c', '.py', '.sh', '.pyi', '.lcm', '.cmake', '.ipynb')


def is_code(span):
    """A name that no sentence would hold by chance."""
    if not CODE.match(span) or span.startswith(('std::', 'boost::')):
        return False
    word = span.removesuffix('()')
    return '::' in word or '()' in span or '_' in word.strip('_') or bool(re.match(r'^[A-Z][a-z0-9]+[A-Z]\w*$', word))


def pages(root):
    return [root / 'README.md', root / 'CONTRIBUTING.md', *sorted((root / 'docs').rglob('*.md'))]


def prose(text):
    """Without fences and indented blocks."""
    text = re.sub(r'^```.*?^```$', '', text, flags=re.MULTILINE | re.DOTALL)
    return '\n'.join('' if line.startswith('    ') else line for line in text.splitlines())


def check_blank_lines(root):
    wrong = []
    for page in pages(root):
        text = page.read_text(encoding='utf-8')
        # A fence keeps its lines, so that the numbers are right.
        text = re.sub(r'^```.*?^```$', lambda fence: re.sub(r'^$', '.', fence[0], flags=re.MULTILINE), text,
                      flags=re.MULTILINE | re.DOTALL)
        wrong += [f'{page.relative_to(root)}:{text.count(chr(10), 0, gap.start()) + 2}: two blank lines: say what was cut, or join'
                  for gap in re.finditer(r'\n[ \t]*\n[ \t]*\n|\n[ \t]*\n\Z', text)]
    return wrong


class Sources:
    """What the tree contains."""

    def __init__(self, root, keys):
        self.root, self.keys, self.words, self.names, self.prefixes = root, set(keys), set(), set(), set()
        self.scopes = []  # of each C++ file: scopes, words
        here = root / 'tests' / 'docs' / 'unchecked_names.txt'
        files = [file for folder in FOLDERS for file in sorted((root / folder).rglob('*')) if file.is_file()]
        for file in [*files, *(root / name for name in FILES)]:
            if file == here or '__pycache__' in file.parts or not file.exists():
                continue
            self.names.add(file.name)
            text = file.read_text(encoding='utf-8', errors='replace')
            words = set(re.findall(r'\w+', text))
            self.words |= words
            if file.suffix in ('.hpp', '.cpp', '.h'):
                self.scopes.append(({part for scope in SCOPE.findall(text) for part in scope.split('::')}, words))
            if file.name == 'CMakeLists.txt':
                self.prefixes |= set(PUT_TOGETHER.findall(text))
        self.sections = {key.split('.')[0] for key in self.keys}

    def has(self, word):
        return word in self.words or any(word.startswith(prefix) and word.removeprefix(prefix) in self.words
                                         for prefix in self.prefixes)

    def lacks(self, span, page):
        """What is wrong with a name, or None."""
        if re.search(r'[*{}<>…=$\s]|[A-Z]{4,}|\.\.\.', span) and '::' not in span:
            return None
        head, _, rest = span.partition('.')
        if rest and head in self.sections and re.match(r'^[\w.]+$', span) and rest != 'x' and not DATA.match(rest):
            known = span in self.keys or any(key.startswith(span.rstrip('.') + '.') for key in self.keys)
            return None if known else 'no configuration key'
        if FILE.match(span) and (span.split('/')[0] in TOP and '/' in span or span.endswith(ENDINGS) and span not in ENDINGS):
            folders = (self.root, self.root / 'src', self.root / 'extras', self.root / 'include' / 'abs_hil', self.root / 'include', page.parent)
            found = any((folder / span).exists() for folder in folders)
            return None if found or ('/' not in span and span in self.names) else 'no such file'
        if is_code(span):
            parts = re.findall(r'\w+', span)
            for scope, name in zip(parts, parts[1:]):
                if not any(scope in scopes and name in words for scopes, words in self.scopes):
                    return f'no source has {name} in {scope}'
            return None if self.has(parts[-1]) else f'no source contains {parts[-1]}'
        return None


def check_names(root, sources, unchecked):
    wrong, used = [], set()
    for page in (page for page in pages(root) if page.name not in RECORDS):
        for span in sorted(set(SPAN.findall(prose(page.read_text(encoding='utf-8'))))):
            fault = sources.lacks(span, page)
            if fault and span in unchecked:
                used.add(span)
            elif fault:
                wrong.append(f'{page.relative_to(root)}: `{span}`: {fault}')
    return wrong + [f'unchecked_names.txt: no page needs `{name}`' for name in sorted(unchecked - used)]


def check_links(root):
    wrong, leads_to = [], {}
    for page in pages(root):
        leads_to[page] = set()
        for link in LINK.findall(prose(page.read_text(encoding='utf-8'))):
            if re.match(r'^(\w+:|#)', link):
                continue
            target = (page.parent / link.split('#')[0]).resolve()
            leads_to[page].add(target)
            if not target.exists():
                wrong.append(f'{page.relative_to(root)}: ({link}): no such file')
    near = leads_to.get(root / 'docs' / 'index.md', set())
    reached = near.union(*(leads_to.get(page, set()) for page in near))
    for page in pages(root):
        if page not in reached and page.parent != root and page.name != 'index.md':
            wrong.append(f'docs/index.md: nothing leads to {page.relative_to(root)}')
    return wrong


def check_words(root, at_most=WORDS_AT_MOST):
    count = sum(len(page.read_text(encoding='utf-8').split()) for page in pages(root))
    return [f'{count} words on all pages, above {at_most}: say less, or say it once'] if count > at_most else []


def read_unchecked(path):
    """NAME, two spaces or more, reason."""
    lines = [line for line in path.read_text(encoding='utf-8').splitlines() if line.strip() and not line.startswith('#')]
    return {re.split(r'\s{2,}', line.strip(), maxsplit=1)[0] for line in lines}


def self_test():
    """Each kind of name, right and wrong; a link that leads nowhere; a page that nothing leads to."""
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for name, text in {'src/run/run.hpp': 'namespace run { class RunLatch; int go_on(); }', 'README.md': '[a](docs/a.md)',
                           'CONTRIBUTING.md': '', 'docs/index.md': '[a](a.md)', 'docs/a.md': '', 'docs/alone.md': '[x](none.md)',
                           'tests/vm/CMakeLists.txt': 'foreach(suite stop) add_test(NAME vm_${suite})'}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding='utf-8')
        sources = Sources(root, ['plant.theta_N', 'control.pi.ki'])
        page = root / 'docs' / 'a.md'
        for right in ('run::RunLatch', 'RunLatch', 'go_on()', 'plant.theta_N', 'control.pi', 'src/run/run.hpp', 'run/run.hpp',
                      'run.hpp', 'src/run', 'any word', 'plain', 'FILE_NAME.toml', 'out/mine.toml', 'plant.x', 'model.toml',
                      'vm_stop'):
            assert sources.lacks(right, page) is None, right
        for wrong in ('run::Latch', 'run::go', 'gone::RunLatch', 'RunLock', 'go_off()', 'go_off', 'plant.tyre', 'plant.theta',
                      'vm_gone', 'src/run/gone.hpp', 'gone.hpp', 'src/gone'):
            assert sources.lacks(wrong, page), wrong
        page.write_text('`RunLock` and `RunLatch`\n\n```\n`Left_Out`\n```\n', encoding='utf-8')
        assert check_names(root, sources, set()) == ['docs/a.md: `RunLock`: no source contains RunLock']
        assert check_names(root, sources, {'RunLock'}) == []
        assert check_names(root, sources, {'RunLock', 'other'}) == ['unchecked_names.txt: no page needs `other`']
        words = sum(len(page.read_text(encoding='utf-8').split()) for page in pages(root))
        assert check_words(root, words) == []
        assert check_words(root, words - 1) == [f'{words} words on all pages, above {words - 1}: say less, or say it once']
        assert check_blank_lines(root) == []
        page.write_text('one\n\n\ntwo\n\n```\n\n\n```\n', encoding='utf-8')
        assert check_blank_lines(root) == ['docs/a.md:2: two blank lines: say what was cut, or join']
        assert check_links(root) == ['docs/alone.md: (none.md): no such file', 'docs/index.md: nothing leads to docs/alone.md']


def main():
    if sys.argv[1:] == ['--self-test']:
        self_test()
        return 0
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    root = pathlib.Path(sys.argv[1]).resolve()
    listed = subprocess.run([sys.argv[2], 'list', '--keys'], capture_output=True, text=True, check=True).stdout
    keys = [line.split()[0] for line in listed.splitlines() if re.match(r'^\w+\.\w', line)]
    wrong = check_names(root, Sources(root, keys), read_unchecked(pathlib.Path(__file__).with_name('unchecked_names.txt')))
    wrong += check_links(root) + check_words(root) + check_blank_lines(root)
    print('\n'.join(wrong), file=sys.stderr)
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
