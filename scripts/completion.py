#!/usr/bin/env python3
"""usage: completion.py bash|zsh|fish|DIR [FOLDER]

Writes tab completion of all programs in FOLDER (default: build/release/bin) for a shell; or for all three into folders of DIR, as
the shells look for it. Subcommands, options and their values come from each program's --help; names of controllers, plants,
experiments and keys from `abs_hil list`, when Tab is pressed.

    source <(scripts/completion.py bash)    # in bash; the same in zsh, after compinit
    scripts/completion.py fish | source
"""
import os
import pathlib
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import NamedTuple

#: programs that people start, but for `abs_hil NAME`, which is abs_NAME
OTHERS = ('abs_guardian', 'abs_rig_emulator')
#: option -> the names that `abs_hil list` has under this heading
NAMES = {'--controller': 'controllers', '--controllers': 'controllers', '--plant': 'plants', '--plants': 'plants', '--model': 'plants',
         '--start': 'plants', '--experiment': 'experiments', '--set': 'keys', 'EXPERIMENT': 'experiments'}


class Option(NamedTuple):
    names: list[str]
    #: '': a flag; 'files', 'any', a heading of `abs_hil list`, 'keys', or the words that are valid
    value: str
    several: bool  #: separated by commas
    meaning: str


class Command(NamedTuple):
    options: list[Option]
    words: list[tuple[str, str]]  #: subcommands, or the words of an argument, with their meaning
    argument: str  #: value of the arguments, as of an option


def value_of(names: list[str], kind: str) -> str:
    known = [NAMES[name] for name in names if name in NAMES]
    if known:
        return known[0]
    if choices := re.search(r'\{([\w,.-]+)\}', kind):
        return choices[1].replace(',', ' ')
    return 'files' if re.search(r'FILE|DIR|FOLDER|LOG|RUN|\bIN\b|\bOUT\b|PATH', kind) else 'any' if kind else ''


def rows(text: str) -> Iterator[tuple[str, str, str]]:
    """Heading of the section, what stands on the left, and its meaning."""
    section, lines = '', text.splitlines()
    width = 30 if 'Usage:' in text else 0  # CLI11's first column; argparse's ends with two spaces
    for line, below in zip(lines, [*lines[1:], '']):
        if heading := re.fullmatch(r'(\S.*):', line):
            section = heading[1].lower()
        row = re.fullmatch(r' {2,4}(\S.*)', line)
        if row is None or not section:
            continue
        if width:
            left, meaning = (line[:width], line[width:]) if len(line) > width and line[width - 1] == ' ' else (line, '')
        else:
            left, _, meaning = row[1].partition('  ')
        if not meaning and re.match(r' {6,}\S', below):
            meaning = below
        yield section, left.strip(), meaning.strip()


def command_of(text: str) -> tuple[Command, list[str]]:
    """What one --help tells, and the names of its subcommands."""
    options, words, argument, subcommands = [], [], '', []
    for section, left, meaning in rows(text):
        if left.startswith('-'):
            left = re.sub(r' Excludes:.*|\{false\}', '', left)
            names = re.findall(r'(?:^|[, ])(--?[A-Za-z][\w-]*)', left)
            kind = re.sub(r'(?:^|, ?)--?[A-Za-z][\w-]*', '', left).strip()
            options.append(Option(names, value_of(names, kind), 'A,B' in kind or '--controllers' in names, meaning))
        elif section == 'subcommands':
            subcommands.append(left)
            words.append((left, meaning))
        elif section.startswith('positional'):
            name, _, kind = left.partition(' ')
            said = re.findall(r'(?:^|\| )([a-z-]+)', meaning) if ' | ' in meaning else re.findall(r'[\w-]+', left) if '{' in left else []
            words += [(word, '') for word in said]
            if not said:
                argument = value_of([name], f'{name} {kind}')
    return Command(options, words, argument), subcommands


class Tables:
    """The commands by their words: 'abs_hil', 'abs_hil study merge', 'abs_guardian serve'."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.commands: dict[str, Command] = {}
        self.programs = ['abs_hil', *(name for name in OTHERS if (folder / name).exists())]
        for name in self.programs:
            self.add(name)
        top = self.commands['abs_hil'].words
        self.commands['abs_hil help'] = Command([], list(top), '')
        top.append(('help', 'the options of a subcommand'))
        self.in_python = sorted(name for file in folder.glob('abs_*') if (name := file.name) not in self.programs
                                and f'abs_hil {name[4:]}' in self.commands)
        for name in self.in_python:
            self.add(name, f'abs_hil {name[4:]}')

    def add(self, words: str, path: str = '') -> None:
        program, *rest = words.split()
        told = subprocess.run([str(self.folder / program), *rest, '--help'], capture_output=True, text=True, timeout=60,
                              env={**os.environ, 'COLUMNS': '1000'})
        if told.returncode != 0:
            print(f'completion.py: {words} --help: status {told.returncode}; its options are left out', file=sys.stderr)
            return
        command, subcommands = command_of(told.stdout)
        if program == 'abs_guardian' and not rest:
            flags = [Option(['-h', '--help'], '', False, ''), Option(['--version'], '', False, '')]
            command, subcommands = Command(flags, [('serve', 'the resident service')], ''), ['serve']
        if before := self.commands.get(path):  # `abs_hil convert` is two programs
            known = {name for option in command.options for name in option.names}
            command.options.extend(option for option in before.options if not known & set(option.names))
        self.commands[path or words] = command
        for name in subcommands:
            self.commands[f'{words} {name}'] = Command([], [], '')  # a program in Python is read later
            if f'{words} {name}' != 'abs_hil ' + name or not (self.folder / f'abs_{name}').exists() or name == 'convert':
                self.add(f'{words} {name}')


def quoted(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


def cases(tables: Tables, row_of: str) -> str:
    """`case` of bash and zsh: for each command its options, words and argument; for each option with a value that value."""
    lines = []
    for path, command in tables.commands.items():
        options = ' '.join(quoted(row_of.format(name, option.meaning.replace(':', ';')) if ':' in row_of else name)
                           for option in command.options for name in option.names)
        words = ' '.join(quoted(row_of.format(word, meaning.replace(':', ';')) if ':' in row_of else word)
                         for word, meaning in command.words)
        lines.append(f'  {quoted(path)}) options=({options}) subcommands=({words}) argument={quoted(command.argument)} ;;')
    return '\n'.join(lines)


def values(tables: Tables) -> str:
    by_value: dict[str, list[str]] = {}
    for path, command in tables.commands.items():
        for option in command.options:
            if option.value:
                by_value.setdefault(option.value + (' ,' if option.several else ''), []).extend(
                    quoted(f'{path} {name}') for name in option.names)
    return '\n'.join(f'  {" | ".join(which)}) value={quoted(value)} ;;' for value, which in by_value.items())


ENGINE = r'''
_abs_hil_table() { # PATH: sets options, subcommands, argument
  options=() subcommands=() argument=""
  case "$1" in
@CASES@
  esac
}

_abs_hil_value() { # PATH OPTION: sets value, empty for a flag
  value=""
  case "$1 $2" in
@VALUES@
  esac
}

_abs_hil_names() { # KIND: the names that `abs_hil list` has, of the program beside the one that is typed
  local program="${1%/*}/abs_hil"
  [[ $1 == */* ]] || program=abs_hil
  case $2 in
    keys) "$program" list --keys 2>/dev/null | awk '{ print $1 "=" }' ;;
    controllers | plants | experiments)
      "$program" list 2>/dev/null | awk -v kind="$2" '/^[a-z]/ { wanted = ($1 == kind); next } wanted { print $1 }' ;;
    files | any) ;;
    *) printf '%s\n' $2 ;;
  esac
}

_abs_hil_path() { # WORD...: sets named to the command that they name, as "abs_hil study merge"
  named=${1##*/}
  case $named in @PYTHON@) named="abs_hil ${named#abs_}" ;; esac
  shift
  local word known
  for word in "$@"; do
    _abs_hil_table "$named"
    for known in "${subcommands[@]}"; do
      [[ ${known%%:*} != "$word" ]] || { named="$named $word"; break; }
    done
  done
  _abs_hil_table "$named"
}
'''

BASH = r'''# Tab completion of abs_hil in bash. scripts/completion.py makes it; do not change it.
''' + ENGINE + r'''
_abs_hil() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]} named value argument before="" words=""
  local -a options subcommands
  _abs_hil_path "${COMP_WORDS[@]:0:COMP_CWORD}"
  _abs_hil_value "$named" "$previous"
  if [[ -z $value && $current == -* ]]; then
    words=${options[*]}
  elif [[ -z $value ]]; then
    value=$argument words=${subcommands[*]}
  fi
  if [[ $value == *" ," ]]; then  # of a list the last name
    value=${value% ,}
    [[ $current != *,* ]] || before=${current%,*},
  fi
  [[ -z $value ]] || words="$words $(_abs_hil_names "${COMP_WORDS[0]}" "$value")"
  mapfile -t COMPREPLY < <(compgen -P "$before" -W "$words" -- "${current#"$before"}")
  if [[ ${#COMPREPLY[@]} -eq 0 && $value != any && $current != -* ]]; then
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
    compopt -o filenames 2>/dev/null  # for files alone: a folder called paper is not the experiment
  fi
  [[ ${COMPREPLY[*]} != *= ]] || compopt -o nospace 2>/dev/null
}
complete -F _abs_hil @PROGRAMS@
'''

ZSH = r'''#compdef @PROGRAMS@
# Tab completion of abs_hil in zsh. scripts/completion.py makes it; do not change it.
''' + ENGINE.replace("printf '%s\\n' $2", "printf '%s\\n' ${=2}") + r'''
_abs_hil() {
  local named value argument
  local -a options subcommands names
  _abs_hil_path "${(@)words[1,CURRENT-1]}"
  _abs_hil_value "$named" "${words[CURRENT-1]}"
  if [[ -z $value && ${words[CURRENT]} == -* ]]; then
    _describe -o option options
    return
  fi
  if [[ -z $value ]]; then
    value=$argument
    (( ${#subcommands} )) && _describe 'command' subcommands
  fi
  [[ $value != *' ,' ]] || { compset -P '*,'; value=${value% ,}; }
  [[ $value == any ]] && return
  names=(${(f)"$(_abs_hil_names "${words[1]}" "$value")"})
  if [[ $value == keys ]]; then
    compadd -S '' -a names
  elif (( ${#names} )); then
    compadd -a names
  fi
  [[ -z $value || $value == (keys|[a-z]*' '[a-z]*) ]] || _files
}
if [[ ${funcstack[1]} == _abs_hil ]]; then  # zsh found this file by its first line, for the first Tab
  _abs_hil "$@"
else
  compdef _abs_hil @PROGRAMS@
fi
'''

FISH = r'''# Tab completion of abs_hil in fish. scripts/completion.py makes it; do not change it.
function __abs_hil_names # KIND: the names that `abs_hil list` has, of the program beside the one that is typed
    set -l program (commandline -opc)[1]
    set program (string replace -r '[^/]*$' abs_hil -- $program)
    switch $argv[1]
        case keys
            $program list --keys 2>/dev/null | awk '{ print $1 "=" }'
        case '*'
            $program list 2>/dev/null | awk -v kind=$argv[1] '/^[a-z]/ { wanted = ($1 == kind); next } wanted { print $1 }'
    end
end
function __abs_hil_at # PATH: the words name this command
    set -l words (commandline -opc)
    set -l path (string replace -r '.*/' '' -- $words[1])
    if contains -- $path @PYTHON@
        set path "abs_hil "(string replace abs_ '' -- $path)
    end
    for word in $words[2..-1]
        if contains -- "$path $word" @PATHS@
            set path "$path $word"
        end
    end
    test "$path" = "$argv[1]"
end
'''


def fish(tables: Tables) -> str:
    def source(value: str, several: bool) -> str:
        if value in ('files', 'any', ''):
            return ''
        names = f'(__abs_hil_names {value})' if value in NAMES.values() else value
        return ' -a ' + quoted(f'(__fish_complete_list , "__abs_hil_names {value}")' if several and value in NAMES.values() else names)
    lines = [FISH]
    for program in [*tables.programs, *tables.in_python]:
        lines.append(f'complete -c {program} -f')
        for path, command in tables.commands.items():
            if path.split()[0] != program and path != f'abs_hil {program[4:]}':
                continue
            at = f'complete -c {program} -n {quoted("__abs_hil_at " + quoted(path))}'
            for option in command.options:
                how = {'': '', 'files': ' -r -F'}.get(option.value, ' -x')
                names = ''.join(f' -l {name[2:]}' if name.startswith('--') else f' -s {name[1:]}' for name in option.names)
                lines.append(f'{at}{names} -d {quoted(option.meaning)}{how}{source(option.value, option.several)}')
            lines += [f'{at} -a {quoted(word)} -d {quoted(meaning)}' for word, meaning in command.words]
            if command.argument and command.argument != 'any':
                lines.append(at + source(command.argument, False) + ('' if command.argument == 'keys' else ' -F'))
    return '\n'.join(lines)


def script(tables: Tables, shell: str) -> str:
    text = {'bash': BASH, 'zsh': ZSH}.get(shell) or fish(tables)
    for mark, with_what in {'@CASES@': cases(tables, '{}:{}' if shell == 'zsh' else '{}'), '@VALUES@': values(tables),
                            '@PROGRAMS@': ' '.join([*tables.programs, *tables.in_python]),
                            '@PYTHON@': (' ' if shell == 'fish' else ' | ').join(tables.in_python) or 'none',
                            '@PATHS@': ' '.join(map(quoted, tables.commands))}.items():
        text = text.replace(mark, with_what)
    return text + '\n'


def write(tables: Tables, to: pathlib.Path) -> None:
    """bash and fish look for a file of the program's name, zsh reads the first line of each file."""
    for shell, name in {'bash': '{}', 'zsh': '_{}', 'fish': '{}.fish'}.items():
        folder = to / shell
        folder.mkdir(parents=True, exist_ok=True)
        main_file = folder / name.format('abs_hil')
        main_file.write_text(script(tables, shell), encoding='utf-8')
        for program in [*tables.programs[1:], *tables.in_python] if shell != 'zsh' else []:
            link = folder / name.format(program)
            link.unlink(missing_ok=True)
            link.symlink_to(main_file.name)


def main() -> int:
    if len(sys.argv) not in (2, 3) or sys.argv[1].startswith('-'):
        print(__doc__, file=sys.stderr)
        return 2
    folder = pathlib.Path(sys.argv[2] if len(sys.argv) == 3 else pathlib.Path(__file__).parents[1] / 'build/release/bin')
    if not (folder / 'abs_hil').exists():
        print(f'completion.py: {folder}: no abs_hil there; build it first, or give its folder', file=sys.stderr)
        return 3
    tables = Tables(folder)
    if sys.argv[1] in ('bash', 'zsh', 'fish'):
        print(script(tables, sys.argv[1]), end='')
    else:
        write(tables, pathlib.Path(sys.argv[1]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
