#!/usr/bin/env python3
"""usage: run_commands.py ROOT BUILD [PAGE...] | --self-test

Runs every command that README.md, CONTRIBUTING.md and the pages of docs/ show, page by page, each page in a scratch folder that
looks like the top of the tree. A command must end with status 0, within its time. not_run.txt lists commands that
cannot run here, with the reason. An entry that matches no command is an error.

A block is a run of lines indented by four spaces, or a fence marked sh. In it
  - a line that begins with a program of ours, or with one of PROGRAMS, is a command; `\\` carries it on; where its comment
    says "status N" it must end with that;
  - `$ command` may end with any status, and its output must contain the lines below it;
  - a server (SERVERS) runs beside the rest of its block until the end;
  - a line with [ ] or | around choices is a synopsis, not a command.
"""
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

PROGRAMS = {'sudo', 'ip', 'cmake', 'git', 'python3', 'octave', 'perf', 'candump', 'cansend', 'lcm-logger', 'lcm-logplayer',
            'lcm-spy', 'apt', 'apt-get', 'modprobe', 'kill', 'echo', 'tail', 'cat', 'rm', 'mkdir', 'cp', 'cd', 'export',
            'dpkg', 'sha256sum', 'pip', 'doxygen', 'cmp', 'cc'}
OURS = re.compile(r'^(\./)?((build/\w+/bin/|build/\w+/tests/)\S+|scripts/\S+|research/\S+|\.ci/run|/tmp/\S+/my_abs_hil|abs_hil|abs_report|'
                  r'abs_tune|abs_learn|abs_identify|abs_benchmark|abs_serve|abs_guardian|abs-spy|abs_rig_emulator)$')
SERVERS = {'abs_rig_emulator', 'abs_guardian', 'abs-spy', 'lcm-logger'}
SYNOPSIS = re.compile(r'\[-|\w\|\w|\.\.\.|<\w+>|\s[A-Z]{4,}(\s|$)')
TIMEOUT_S = 240


def blocks(text):
    """Runs of indented lines and sh fences, as lists of lines; other fences are skipped."""
    found, block, fence = [], [], None
    for line in text.splitlines():
        if fence is not None:
            if line.startswith('```'):
                if fence == 'sh' and block:
                    found.append(block)
                block, fence = [], None
            elif fence == 'sh':
                block.append(line)
            continue
        if line.startswith('```'):
            if block:
                found.append(block)
            block, fence = [], line[3:].strip().split(' ')[0]
        elif line.startswith('    '):
            block.append(line[4:])
        elif block:
            found.append(block)
            block = []
    return found + ([block] if block else [])


def first_word(line):
    words = line.split()
    while words and re.match(r'^\w+=', words[0]):
        words.pop(0)
    return words[0] if words else ''


def commands(block):
    """(command, lines it must print or None) of a block."""
    found, lines = [], list(block)
    while lines:
        line = lines.pop(0)
        shown = line.startswith('$ ')
        if shown:
            line = line[2:]
        if not (OURS.match(first_word(line)) or first_word(line) in PROGRAMS):
            continue
        while line.endswith('\\') and lines:
            line = line[:-1] + lines.pop(0).strip()
        if shown:
            printed = []
            while lines and not lines[0].startswith('$ '):
                printed.append(lines.pop(0))
            found.append((line, printed))
        elif not SYNOPSIS.search(line.split('#')[0]):
            found.append((line, None))
    return found


class Exceptions:
    """not_run.txt: PATTERN, two spaces or more, reason."""

    def __init__(self, path):
        self.entries, self.used = [], set()
        for line in path.read_text().splitlines():
            if line.strip() and not line.startswith('#'):
                pattern, reason = re.split(r'\s{2,}', line.strip(), maxsplit=1)
                self.entries.append((re.compile(pattern), reason))

    def reason(self, command):
        for pattern, reason in self.entries:
            if pattern.search(command):
                self.used.add(pattern)
                return reason
        return None

    def unused(self):
        return [pattern.pattern for pattern, _ in self.entries if pattern not in self.used]


class Scratch:
    """A folder with the tree's entries as links, or the given folder; our programs on the PATH, and servers."""

    def __init__(self, root, build, folder=None):
        self.temporary = None if folder else tempfile.TemporaryDirectory()
        self.folder = folder or self.temporary.name
        for entry in () if folder else root.iterdir():
            if entry.name not in ('runs', '.git'):
                (pathlib.Path(self.folder) / entry.name).symlink_to(entry)
        self.environment = dict(os.environ, PATH=f'{build}/bin:' + os.environ['PATH'])
        self.servers = []
        # What pages put into /tmp goes here: there it may belong to somebody else, or be left from a killed test.
        self.tmp = tempfile.TemporaryDirectory()

    def run(self, command, printed):
        """What is wrong, or None."""
        command = re.sub(r'(?<![\w.])/tmp/', f'{self.tmp.name}/', command)
        if os.path.basename(first_word(command)) in SERVERS:
            return self.serve(command)
        try:
            done = subprocess.run(['bash', '-o', 'pipefail', '-c', command], cwd=self.folder, env=self.environment,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                  timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f'not over after {TIMEOUT_S} s'
        if printed is None:
            told = re.search(r'#.*\bstatus (\d+)', command)
            expected = int(told.group(1)) if told else 0
            return None if done.returncode == expected else f'status {done.returncode}:\n{done.stdout[-1500:]}'
        squeezed = ' '.join(done.stdout.split())
        missing = [line for line in printed if ' '.join(line.split()) not in squeezed]
        return f'does not print {missing}, but\n{done.stdout[-1500:]}' if missing else None

    def serve(self, command):
        server = subprocess.Popen(['bash', '-c', 'exec ' + command], cwd=self.folder, env=self.environment,
                                  stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  start_new_session=True)
        self.servers.append(server)
        time.sleep(1.5)  # nothing reports that its mount or socket is ready
        if server.poll() not in (None, 0):
            return f'ended with status {server.returncode}:\n{server.stdout.read().decode()[-1500:]}'
        return None

    def end_servers(self):
        for server in reversed(self.servers):
            if server.poll() is None:
                os.killpg(server.pid, signal.SIGTERM)
                server.wait(timeout=20)
        self.servers = []

    def close(self):
        self.end_servers()
        self.tmp.cleanup()
        if self.temporary:
            self.temporary.cleanup()


def check(root, build, pages, exceptions):
    wrong, ran, skipped = [], 0, []
    for page in pages:
        scratch = Scratch(root, build)
        for block in blocks(page.read_text()):
            for command, printed in commands(block):
                reason = exceptions.reason(command)
                if reason:
                    skipped.append(f'{page.relative_to(root)}: {command}: {reason}')
                    continue
                start = time.monotonic()
                fault = scratch.run(command, printed)
                ran += 1
                print(f'{page.relative_to(root)}: {command}: {"FAILED" if fault else "ok"}, '
                      f'{time.monotonic() - start:.1f} s', flush=True)
                if fault:
                    wrong.append(f'{page.relative_to(root)}: {command}\n  {fault}')
            scratch.end_servers()
        scratch.close()
    print(f'{ran} commands run, {len(skipped)} not run:')
    print('\n'.join('  ' + line for line in skipped))
    return wrong, ran


def self_test():
    page = 'text\n\n    echo one   # note\n    abs_hil [--csv FILE]\n    echo two \\\n        three\n\n```sh\necho four\n```\n' \
           '```\necho no\n```\n\n    $ cat nothing\n    cat: nothing: No such file\n'
    found = [c for block in blocks(page) for c in commands(block)]
    expected = [('echo one   # note', None), ('echo two three', None), ('echo four', None),
                ('cat nothing', ['cat: nothing: No such file'])]
    assert found == expected, found
    here = pathlib.Path(__file__).parent
    scratch = Scratch(here, here)
    assert scratch.run('echo one', None) is None
    assert scratch.run('false', None) is not None
    assert scratch.run('exit 3  # refused: status 3', None) is None
    assert scratch.run('echo one  # status 3', None) is not None
    assert scratch.run('echo one', ['two']) is not None
    assert scratch.run('echo one; false', ['one']) is None
    assert scratch.run('echo kept > /tmp/of_the_page', None) is None
    assert pathlib.Path(scratch.tmp.name, 'of_the_page').read_text() == 'kept\n'
    scratch.close()


def main():
    if sys.argv[1:] == ['--self-test']:
        self_test()
        return 0
    if len(sys.argv) < 3:
        print(__doc__, file=sys.stderr)
        return 2
    root, build = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    everything = [root / 'README.md', root / 'CONTRIBUTING.md', *sorted((root / 'docs').rglob('*.md'))]
    everything.remove(root / 'docs' / 'tutorial.md')  # it changes the tree: tutorial_test.py runs it in a copy
    pages = [root / page for page in sys.argv[3:]] or everything
    exceptions = Exceptions(pathlib.Path(__file__).parent / 'not_run.txt')
    wrong, ran = check(root, build, pages, exceptions)
    if pages == everything:
        wrong += [f'not_run.txt: {pattern} matches no command' for pattern in exceptions.unused()]
    print('\n'.join(wrong), file=sys.stderr)
    return 1 if wrong or ran == 0 else 0


if __name__ == '__main__':
    sys.exit(main())
