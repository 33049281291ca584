"""usage: completion_test.py PROGRAM SCRIPT: what scripts/completion.py offers at some places of a command line, in real shells.
The options are held against each program's own --help, read here in another way."""
import os
import pathlib
import pty
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM, SCRIPT = pathlib.Path(sys.argv.pop(1)).resolve(), sys.argv.pop(1)
FOLDER = PROGRAM.parent
#: command lines whose last word is completed -> what is offered, in order
PLACES = {('validate', 'pape'): 'paper', ('re',): 'replay report', ('va',): 'validate', ('hel',): 'help', ('help', 'va'): 'validate',
          ('--contr',): '--controller --controllers', ('--plant', 'paper-table1', '--co'): '--config --controller --controllers',
          ('compare', '--controllers', 'adaptive,p'): 'adaptive,pi', ('--set', 'control.adaptive.g'): 'control.adaptive.gamma=',
          ('--experiment', 'slip-s'): 'slip-sweep', ('--experiment', 'paper', '--backend', ''): 'rig sim', ('study', 'm'): 'merge',
          ('send', 'st'): 'start stop', ('doctor', '--only', 'c'): 'can clock cpu', ('safe', '--'): '--config --help --insist --set',
          ('convert', '--li'): '--live', ('rig', 's'): 'steady', ('tune', '--plants', 'paper-table1,inteco-m'): 'paper-table1,inteco-manual',
          ('study', 'status', '--'): '--help', ('report', '--form'): '--format', ('report', '--format', 's'): 'svg'}
PLACES_OF_OTHERS = {('abs_tune', '--contr'): '--controller --controllers', ('abs_guardian', 's'): 'serve',
                    ('abs_guardian', 'serve', '--so'): '--socket', ('abs_rig_emulator', '--wr'): '--wrong-board',
                    ('abs_identify', '--form', 'm'): 'magic-formula'}


class Shell:
    """A shell that has the completion, and tells what it offers for the last word."""
    def __init__(self, script: pathlib.Path, folder: pathlib.Path) -> None:
        self.script, self.folder = script, folder

    def offers(self, words: tuple[str, ...]) -> list[str]:
        asked = subprocess.run([*self.command(), *map(str, words)], cwd=self.folder, capture_output=True, text=True, check=False)
        if asked.returncode or asked.stderr:
            raise AssertionError(f'{words}: {asked.returncode} {asked.stderr}')
        return sorted({line for line in asked.stdout.splitlines() if line})

    def command(self) -> list[str]:
        raise NotImplementedError


class Bash(Shell):
    def command(self) -> list[str]:
        return ['bash', '-c', f'source {self.script}; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); compopt() {{ :; }}; _abs_hil; '
                'printf "%s\\n" "${COMPREPLY[@]}"', 'bash']


class Zsh(Shell):
    """Its own functions show what they are given; of files those of the folder that match."""
    def command(self) -> list[str]:
        return ['zsh', '-f', '-c', 'compdef() { :; }; source ' + str(self.script) + r'''
            words=("$@") CURRENT=$# PREFIX=${words[CURRENT]} before=""
            matching() { local one; for one in "$@"; do [[ -n $one && $one == $PREFIX* ]] && print -r -- $before$one; done }
            compset() { [[ $PREFIX == *,* ]] && { before=${PREFIX%,*}, PREFIX=${PREFIX##*,}; } }
            compadd() { matching "${(@P)@[-1]}"; }
            _describe() { matching "${(@)${(@P)@[-1]}%%:*}"; }
            _files() { local -a there=(*(N)); [[ $PREFIX == -* ]] || matching $there; }
            _abs_hil; true''', 'zsh']


class Fish(Shell):
    def command(self) -> list[str]:
        return ['fish', '--no-config', '-c', f'source {self.script}; complete -C (string join -- " " $argv) | string replace -r "\\t.*" ""; true']


class Completion(unittest.TestCase):
    made: pathlib.Path

    @classmethod
    def setUpClass(cls) -> None:
        cls.made = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        subprocess.run([sys.executable, SCRIPT, cls.made, FOLDER], check=True)

    def setUp(self) -> None:
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        (self.folder / 'runs').mkdir()
        (self.folder / 'paper_notes').mkdir()

    def shell(self, name: str, kind: type[Shell]) -> Shell:
        if shutil.which(name) is None:
            self.skipTest(f'{name} is not installed')
        return kind(self.made / name / {'bash': 'abs_hil', 'zsh': '_abs_hil', 'fish': 'abs_hil.fish'}[name], self.folder)

    def check(self, shell: Shell) -> None:
        for words, expected in {**{(PROGRAM, *words): offer for words, offer in PLACES.items()},
                                **{(FOLDER / words[0], *words[1:]): offer for words, offer in PLACES_OF_OTHERS.items()}}.items():
            with self.subTest(words=words[1:]):
                offers = shell.offers(words)
                if not isinstance(shell, Bash):  # where a file is right as well, they offer both
                    offers = [word for word in offers if word.strip('/').rpartition(',')[2] != 'paper_notes']
                self.assertEqual(offers, expected.split())
        for words in (('report', 'ru'), ('study', 'status', 'ru'), ('study', '--out', 'ru'), ('--config', 'ru')):
            with self.subTest(words=words):
                self.assertEqual([word.rstrip('/') for word in shell.offers((PROGRAM, *words))], ['runs'])
        for words in self.every_command():
            with self.subTest(words=words):
                shown = self.options_in_help(words)
                self.assertTrue(shown, words)
                self.assertEqual(set(shell.offers((FOLDER / words[0], *words[1:], '--'))), shown)

    def every_command(self) -> list[tuple[str, ...]]:
        names = re.findall(r'^  ([a-z][a-z-]*)', self.help(('abs_hil',)).partition('Subcommands:')[2], re.MULTILINE)
        self.assertGreater(len(names), 20)
        below = [('abs_hil', 'study', word) for word in ('merge', 'status', 'submit')]
        others = [(file.name,) for file in sorted(FOLDER.glob('abs_*'))
                  if file.name not in ('abs_hil', 'abs_hil_program', 'abs_controller_host', 'abs_python_host', 'abs_guardian', 'abs_convert')]
        return [('abs_hil',), *(('abs_hil', name) for name in names if name != 'convert'), *below, ('abs_guardian', 'serve'), *others]

    def help(self, words: tuple[str, ...]) -> str:
        return subprocess.run([FOLDER / words[0], *words[1:], '--help'], capture_output=True, text=True, check=True,
                              env={**os.environ, 'COLUMNS': '80'}).stdout

    def options_in_help(self, words: tuple[str, ...]) -> set[str]:
        """The long options that stand at the beginning of their lines; what is said of other options stands further right."""
        found: set[str] = set()
        for line in self.help(words).splitlines():
            if row := re.match(r' {2,4}(-\S.*)', line):
                head = re.split(r'  | Excludes:', row[1])[0]
                found |= set(re.findall(r'(?:^|[, ])(--[a-z][a-z0-9-]*)', head))
        return found

    def test_each_program_has_a_file_of_its_name(self) -> None:
        for name in ('abs_hil', 'abs_guardian', 'abs_rig_emulator', 'abs_report', 'abs_tune'):
            if (FOLDER / name).exists():
                self.assertEqual((self.made / 'bash' / name).read_text(), (self.made / 'bash' / 'abs_hil').read_text())
                self.assertEqual((self.made / 'fish' / f'{name}.fish').read_text(), (self.made / 'fish' / 'abs_hil.fish').read_text())
                self.assertIn(name, (self.made / 'zsh' / '_abs_hil').read_text().splitlines()[0].split())

    def test_the_script_for_one_shell_is_that_of_the_folder(self) -> None:
        told = subprocess.run([sys.executable, SCRIPT, 'bash', FOLDER], capture_output=True, text=True, check=True)
        self.assertEqual((told.stdout, told.stderr), ((self.made / 'bash' / 'abs_hil').read_text(), ''))
        for args, status in (([], 2), (['bash', self.folder], 3), (['--help'], 2)):
            wrong = subprocess.run([sys.executable, SCRIPT, *args], capture_output=True, text=True, check=False)
            self.assertEqual((wrong.returncode, wrong.stdout), (status, ''))

    def test_bash(self) -> None:
        self.check(self.shell('bash', Bash))

    def test_zsh(self) -> None:
        self.check(self.shell('zsh', Zsh))

    def test_fish(self) -> None:
        self.check(self.shell('fish', Fish))

    def test_tab_in_zsh_itself(self) -> None:
        """A terminal, its own completion system, and a Tab."""
        script = self.shell('zsh', Zsh).script
        parent, child = pty.openpty()
        with subprocess.Popen(['zsh', '-f', '-i'], stdin=child, stdout=child, stderr=child, start_new_session=True, cwd=self.folder,
                              env={**os.environ, 'PATH': f'{FOLDER}:{os.environ["PATH"]}', 'TERM': 'dumb'}) as shell:
            os.close(child)
            os.write(parent, f'fpath=({script.parent} $fpath); autoload -U compinit; compinit -u -D; '
                     'show() { print -r -- "<<$BUFFER>>" }; zle -N show; bindkey "^X" show; print rea""dy\n'.encode())
            said = b''
            sent = False
            while b'>>' not in said.partition(b'ready')[2].partition(b'<<')[2]:
                said += os.read(parent, 65536)
                if not sent and b'ready' in said:
                    os.write(parent, b'abs_hil --plant inteco-m\t\x18')
                    sent = True
            shell.kill()
        os.close(parent)
        self.assertIn(b'<<abs_hil --plant inteco-manual >>', said)


if __name__ == '__main__':
    unittest.main()
