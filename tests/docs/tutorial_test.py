#!/usr/bin/env python3
"""usage: tutorial_test.py ROOT BUILD

Does what docs/tutorial.md says, command by command, in a copy of the tree of ROOT: a newcomer's clone. Files that the
page shows (```LANGUAGE ... tutorial=NAME) are written under their names. BUILD is a build of ROOT, for ccache's settings.
"""
import pathlib
import re
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / 'one_row'))
import run_commands
from scratch_copy import ScratchCopy

# Everything else than our programs that the page calls.
run_commands.PROGRAMS |= {'sed', 'cmp', 'ctest'}
SHOWN_FILE = re.compile(r'^```[^\n]* ?tutorial=(\S+)\n(.*?)^```$', re.MULTILINE | re.DOTALL)
TIMEOUT_S = 600


def check_summary(output):
    """The text of section 1: what a run prints."""
    for line in ('stop time', 'stop distance'):
        assert re.search(rf'{line} +\d', output), output[-2000:]


def main():
    root, build = map(pathlib.Path, sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder:
        page = (root / 'docs' / 'tutorial.md').read_text(encoding='utf-8')
        copy = ScratchCopy(root, build, pathlib.Path(folder))
        tree = copy.tree
        # The private network reaches no index, so the Python modules come from this tree.
        (tree / 'build').mkdir()
        (tree / 'build' / 'python').symlink_to(root / 'build' / 'python')
        for name, text in SHOWN_FILE.findall(page):
            (tree / name).write_text(text, encoding='utf-8')
        scratch = run_commands.Scratch(tree, tree / 'build' / 'release', str(tree))
        run_commands.TIMEOUT_S = TIMEOUT_S
        failures = 0
        for block in run_commands.blocks(page):
            for command, printed in run_commands.commands(block):
                start = time.monotonic()
                problem = scratch.run(command, printed)
                print(f'{command}: {problem or "ok"}, {time.monotonic() - start:.1f} s', flush=True)
                failures += problem is not None
            scratch.end_servers()
        scratch.close()
        first = subprocess.run([tree / 'build/release/bin/abs_hil', '--fast', '--no-lcm'], capture_output=True, text=True)
        check_summary(first.stdout)
        events = (tree / 'runs' / 'two-slips' / 'events.csv').read_text()
        assert 'brake-low' in events and 'brake-high' in events, events
        assert (tree / 'histogram.png').stat().st_size > 1000
        return 1 if failures else 0


if __name__ == '__main__':
    sys.exit(main())
