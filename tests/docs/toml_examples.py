#!/usr/bin/env python3
"""usage: toml_examples.py ABS_HIL ROOT

Checks every TOML example of the documentation by the kind that its fence names:

    ```toml experiment       a whole experiment file: must be valid, within the limits and run to its end in simulation
    ```toml more-of-it       is appended to the experiment above it on the page
    ```toml configuration    is a file for --config
    ```toml study            is a study, for abs_hil study

Other TOML in a page, fenced or indented, is an error.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

KINDS = ('experiment', 'more-of-it', 'configuration', 'study')


def blocks_of(page):
    """(line, kind, text) of each fenced TOML block; raises for TOML that has no fence or no kind."""
    blocks, fence = [], None
    for number, line in enumerate(page.splitlines(), 1):
        if line.startswith('```'):
            words = line[3:].split()
            if fence is not None:
                fence = None
            else:
                fence = words or ['']
                if fence[0] == 'toml':
                    if len(words) < 2 or words[1] not in KINDS:
                        raise ValueError(f'line {number}: write ```toml with one of {", ".join(KINDS)}')
                    blocks.append((number, words[1], []))
        elif fence is None and re.match(r' {4}\[\[?[a-z_.]+\]\]?\s*(#.*)?$', line):
            raise ValueError(f'line {number}: TOML without a fence: {line.strip()}')
        elif fence and fence[0] == 'toml':
            blocks[-1][2].append(line)
    return [(number, kind, '\n'.join(lines) + '\n') for number, kind, lines in blocks]


def run(program, folder, *args):
    return subprocess.run([program, *map(str, args)], cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def check(program, folder, where, kind, text):
    """Problems with one block; `text` is whole."""
    file = folder / 'example.toml'
    file.write_text(text)
    if kind == 'configuration':
        calls = [('validate', 'paper', '--config', file)]
    elif kind == 'study':
        calls = [('study', file, '--out', tempfile.mkdtemp(dir=folder))]
    else:
        calls = [('validate', file)]
        if not re.search(r'^\[(series|vary)\]', text, re.MULTILINE):
            calls.append(('--backend', 'sim', '--fast', '--no-lcm', '--no-out', '--experiment', file))
    for call in calls:
        result = run(program, folder, *call)
        if result.returncode:
            yield f'{where} ({kind}): status {result.returncode} of {call[0]}: {result.stderr.strip()}'


def main():
    program, root = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
    problems, seen = [], dict.fromkeys(KINDS, 0)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for path in sorted([*root.glob('*.md'), *root.glob('docs/**/*.md'), *root.glob('examples/**/*.md')]):
            whole = None
            try:
                blocks = blocks_of(path.read_text())
            except ValueError as problem:
                problems.append(f'{path.relative_to(root)}, {problem}')
                continue
            for line, kind, text in blocks:
                seen[kind] += 1
                where = f'{path.relative_to(root)}, line {line}'
                if kind == 'more-of-it' and whole is None:
                    problems.append(f'{where}: there is no experiment above it')
                    continue
                whole = text if kind == 'experiment' else whole
                problems += check(program, folder, where, kind, whole + text if kind == 'more-of-it' else text)
    problems += [f'no example of kind "{kind}" was found: is the test looking in the right place?'
                 for kind, count in seen.items() if not count]
    for problem in problems:
        print(problem)
    print(', '.join(f'{count} {kind}' for kind, count in seen.items()))
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
