"""A copy of the source tree that a test may change and build."""
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess

# What a build of the copy takes from the build that the test belongs to.
SAME = ('CMAKE_CXX_COMPILER', 'CMAKE_CXX_COMPILER_LAUNCHER', 'CMAKE_MAKE_PROGRAM', 'CMAKE_PREFIX_PATH')


def cache_of(build):
    """Entries of a build's CMakeCache.txt."""
    text = (build / 'CMakeCache.txt').read_text(encoding='utf-8')
    return dict(re.findall(r'^([\w-]+):\w+=(.*)$', text, re.MULTILINE))


class ScratchCopy:
    def __init__(self, root, build, folder):
        """Copies the tree of `root`, uncommitted files too, to folder/tree, which must not exist. `build` is a build of
        `root`."""
        self.root, self.tree, self.build = root, folder / 'tree', folder / 'build'
        self.cache = cache_of(build)
        listed = subprocess.run(['git', '-C', root, 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                                check=True, capture_output=True, text=True).stdout
        self.tree.mkdir(parents=True)
        for name in filter(None, listed.split('\0')):
            source, target = root / name, self.tree / name
            if not source.is_symlink() and not source.exists():
                continue  # deleted, but not yet committed
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)
        self.environment = {**os.environ, 'CCACHE_BASEDIR': str(folder), 'CCACHE_NOHASHDIR': '1'}

    def change(self, name, old, new):
        """Replaces the only `old` of a file by `new`."""
        path = self.tree / name
        text = path.read_text(encoding='utf-8')
        if text.count(old) != 1:
            raise AssertionError(f'{name} holds {text.count(old)} times, not once: {old}')
        path.write_text(text.replace(old, new), encoding='utf-8')

    def insert_before(self, name, begin, end, row):
        """Inserts the line `row` before the first line `end` that follows the line `begin`."""
        path = self.tree / name
        lines = path.read_text(encoding='utf-8').split('\n')
        start = next((n for n, line in enumerate(lines) if line.startswith(begin)), None)
        if start is None or end not in lines[start:]:
            raise AssertionError(f'{name} has no "{begin}" with a line "{end}" behind it')
        lines.insert(lines.index(end, start), row)
        path.write_text('\n'.join(lines), encoding='utf-8')

    def changed_lines(self, name):
        """(added, removed) lines of a file against the original."""
        result = subprocess.run(['git', 'diff', '--no-index', '--numstat', self.root / name, self.tree / name],
                                capture_output=True, text=True)
        added, removed = result.stdout.split()[:2] if result.stdout else (0, 0)
        return int(added), int(removed)

    def run(self, *command, status=0):
        """Output and error text of a command in the copy. AssertionError for another exit status than `status`."""
        result = subprocess.run([str(part) for part in command], cwd=self.tree, env=self.environment, text=True,
                                capture_output=True)
        if result.returncode != status:
            raise AssertionError(f'{shlex.join(map(str, command))} ended with status {result.returncode}, not {status}:\n'
                                 f'{result.stdout[-6000:]}{result.stderr[-6000:]}')
        return result.stdout + result.stderr

    def configure(self, python=False):
        """Without optimisation and without tests: the cheapest build that runs."""
        same = [f'-D{name}={self.cache[name]}' for name in SAME if self.cache.get(name)]
        self.run('cmake', '-S', self.tree, '-B', self.build, '-G', self.cache['CMAKE_GENERATOR'], *same,
                 '-DCMAKE_BUILD_TYPE=Debug', '-DCMAKE_CXX_FLAGS_DEBUG=', '-DABS_HIL_TESTS=OFF', '-DABS_HIL_BENCH=OFF', 
                 f'-DABS_HIL_PYTHON={"ON" if python else "OFF"}')

    def make(self, *targets):
        self.run('cmake', '--build', self.build, '--target', *targets)

    def compiler_says(self, room, name):
        """Messages of the compiler for the one source `name` of a room, made with the room's own options."""
        commands = json.loads((self.build / 'compile_commands.json').read_text(encoding='utf-8'))
        entry = next(entry for entry in commands if f'abs_hil_{room}.dir/' in entry['command'])
        words = shlex.split(entry['command'])
        if 'ccache' in pathlib.Path(words[0]).name:
            words = words[1:]
        words = words[:words.index('-o')] + ['-fsyntax-only', str(self.tree / name)]
        return subprocess.run(words, cwd=entry['directory'], capture_output=True, text=True).stderr
