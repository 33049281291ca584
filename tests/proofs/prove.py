#!/usr/bin/env python3
"""Proves the claims of a file like node.toml about C code with CBMC, tries that the proofs are about something, and that they
refute changed code. scripts/proofs.sh installs CBMC and starts this.

usage: prove.py TOOLS WORK [--only NAME,...]
       prove.py --fit          looks only whether code and page have what the files name

A file has the tables
  [code]         file: the code, from the project's root. put: pairs of a line that occurs once and the line that comes behind
                 it in the copy that is proved; a contract of a loop, in capitals, comes before the loop's brace
  [[proof]]      name: the function whose contract is enforced, or `world`. by: contracts that stand for the functions that it
                 calls. loops: its loops have contracts. says: what is proved. carries: a sentence of docs/safety.md, or what of
                 it. covers: checks that must fail under -DCOVER
  [[mutant]]     name, of: proofs of which one must refute it, old: text of the code that occurs once, new
Status 1: a proof fails or takes too long, a check of a cover holds, a mutant is not refuted, or a sentence is not in the page.
"""
import argparse
import concurrent.futures
import pathlib
import re
import shutil
import subprocess
import sys
import time
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIMIT_S = 280
CHECKS = ('--unwinding-assertions', '--bounds-check', '--pointer-check', '--pointer-overflow-check', '--signed-overflow-check',
          '--undefined-shift-check', '--div-by-zero-check')
#: the greatest number of entries in a list of what a function may change
UNWIND = ('--unwind', '10', '--unwindset', '__CPROVER_contracts_write_set_check_assigns_clause_inclusion.0:60')


class Wrong(Exception):
    pass


def replaced(text: str, old: str, new: str) -> str:
    if text.count(old) != 1:
        raise Wrong(f'this occurs {text.count(old)} times in the code: {old!r}')
    return text.replace(old, new)


def prepared(folder: pathlib.Path, work: pathlib.Path, code: dict, change: tuple[str, str] | None = None) -> None:
    """The copy of the code that is proved, with what is put into it, beside the entries."""
    shutil.copytree(folder, work, dirs_exist_ok=True)
    source = ROOT / code['file']
    text = source.read_text()
    if change:
        text = replaced(text, *change)
    for place, what in code['put']:
        loop = place.endswith(' {') and what.isupper()
        text = replaced(text, place, f'{place[:-1]}{what} {{' if loop else f'{place}\n{what}')
    (work / 'core.c').write_text(text)
    shutil.copy(source.with_suffix('.h'), work)


def run(tools: pathlib.Path, work: pathlib.Path, proof: dict, cover: bool = False) -> tuple[dict[str, bool], float]:
    """Whether each check holds, and seconds."""
    name, began = proof['name'], time.monotonic()
    goto, made = work / f'{name}{cover:d}.goto', work / f'{name}{cover:d}.made.goto'

    def call(program: str, *words: str) -> str:
        left_s = LIMIT_S - (time.monotonic() - began)
        try:
            told = subprocess.run([tools / program, *words], cwd=work, capture_output=True, text=True, timeout=max(left_s, 1))
        except subprocess.TimeoutExpired:
            raise Wrong(f'{name}: no answer within {LIMIT_S} s') from None
        if told.returncode not in ((0, 10) if program == 'cbmc' else (0,)):
            raise Wrong(f'{name}: {program} ended with {told.returncode}: {(told.stdout + told.stderr)[-800:]}')
        return told.stdout + told.stderr
    call('goto-cc', *(['-DCOVER'] if cover else []), '-o', str(goto), 'proof.c', '--function', f'prove_{name}')
    if proof.get('contracts', True):
        enforced = [] if name == 'world' else ['--enforce-contract', name]
        by = [word for one in proof.get('by', []) for word in ('--replace-call-with-contract', one)]
        loops = ['--apply-loop-contracts'] if proof.get('loops') else []
        said = call('goto-instrument', '--dfcc', f'prove_{name}', *loops, *by, *enforced, str(goto), str(made))
    else:
        made, said = goto, ''
    said += call('cbmc', str(made), '--function', f'prove_{name}', *UNWIND, *CHECKS, *proof.get('options', []), '--slice-formula',
                 '--external-sat-solver', str(tools / 'cadical'))
    checks = {f'{one} {what}': holds == 'SUCCESS'
              for one, what, holds in re.findall(r'^\[(\S+)\] (.*): (SUCCESS|FAILURE|UNKNOWN|ERROR)$', said, re.MULTILINE)}
    if not checks or any('undefined function' in one and not holds for one, holds in checks.items()):
        raise Wrong(f'{name}: nothing was checked, or a function is missing')
    return checks, time.monotonic() - began


def safety_page() -> str:
    return ' '.join((ROOT / 'docs/safety.md').read_text().split())


def fit() -> int:
    """Status 1 if a file names what code or page have no more."""
    wrong = []
    for file in sorted(pathlib.Path(__file__).parent.glob('*.toml')):
        told = tomllib.loads(file.read_text())
        names = [one['name'] for one in told['proof']]
        text = (ROOT / told['code']['file']).read_text()
        wrong += [f'{told["code"]["file"]} has {text.count(old)} times {old!r}' for old in
                  [one for one, _ in told['code']['put']] + [one['old'] for one in told['mutant']] if text.count(old) != 1]
        wrong += [f'docs/safety.md does not say "{one["carries"]}"' for one in told['proof']
                  if one.get('carries', '') not in safety_page()]
        wrong += [f'no proof {one}' for mutant in told['mutant'] for one in mutant['of'] if one not in names]
    print(*[f'{one}; mend tests/proofs' for one in wrong] or ['code and page have what the proofs name'], sep='\n')
    return 1 if wrong else 0


class Campaign:
    """The proofs and mutants of one file; `wrong` says what is not as it should be."""

    def __init__(self, file: pathlib.Path, tools: pathlib.Path, work: pathlib.Path) -> None:
        self.told = tomllib.loads(file.read_text())
        self.name, self.folder, self.tools, self.work = file.stem, file.with_suffix(''), tools, work / file.stem
        self.wrong: list[str] = []
        self.proved: list[str] = []
        self.refuted: list[str] = []
        shutil.rmtree(self.work, ignore_errors=True)
        prepared(self.folder, self.work / 'code', self.told['code'])

    def say(self, text: str) -> None:
        print(f'{self.name} {text}', flush=True)

    def prove(self, proof: dict) -> None:
        name = proof['name']
        checks, seconds = run(self.tools, self.work / 'code', proof)
        failed = [one for one, holds in checks.items() if not holds]
        self.wrong += [f'{name}: fails: {one}' for one in failed[:5]]
        reached: set[str] = set()
        if proof.get('covers'):
            covers, more_s = run(self.tools, self.work / 'code', proof, cover=True)
            seconds += more_s
            reached = {one.partition('COVER ')[2] for one, holds in covers.items() if 'COVER' in one and not holds}
            if len(reached) != proof['covers']:
                self.wrong.append(f'{name}: reaches {len(reached)} of {proof["covers"]} states: it may be about nothing')
        self.proved.append(name)
        self.say(f'{name}: {len(checks) - len(failed)} checks hold, {len(failed)} fail, {len(reached)} states reached, '
                 f'{seconds:.0f} s')

    def mutate(self, mutant: dict) -> None:
        name, began = mutant['name'], time.monotonic()
        place = self.work / name.replace(' ', '-')
        prepared(self.folder, place, self.told['code'], (mutant['old'], mutant['new']))
        for by in mutant['of']:
            checks, _ = run(self.tools, place, next(one for one in self.told['proof'] if one['name'] == by))
            failed = [one for one, holds in checks.items() if not holds]
            if failed:
                self.refuted.append(name)
                return self.say(f'mutant "{name}": refuted by {by} in {time.monotonic() - began:.0f} s: {failed[0][:80]}')
        self.wrong.append(f'mutant "{name}": not refuted')
        return None

    def jobs(self, only: set[str]) -> list[tuple]:
        jobs = [(self.prove, one) for one in self.told['proof']] + [(self.mutate, one) for one in self.told['mutant']]
        return [(act, one) for act, one in jobs if not only or one['name'] in only]


def main() -> int:
    if sys.argv[1:] == ['--fit']:
        return fit()
    parser = argparse.ArgumentParser(description='Proves the claims of docs/safety.md that tests/proofs holds.')
    parser.add_argument('tools', type=pathlib.Path)
    parser.add_argument('work', type=pathlib.Path)
    parser.add_argument('--only', default='', help='names of proofs and mutants, with commas between them')
    parser.add_argument('--jobs', type=int, default=2)
    given = parser.parse_args()
    only = {*filter(None, given.only.split(','))}
    began = time.monotonic()
    wrong = [] if fit() == 0 else ['code or page lack what the proofs name']
    campaigns = [] if wrong else [Campaign(file, given.tools.resolve(), given.work.resolve())
                                  for file in sorted(pathlib.Path(__file__).parent.glob('*.toml'))]
    with concurrent.futures.ThreadPoolExecutor(given.jobs) as pool:
        for done in [pool.submit(act, one) for campaign in campaigns for act, one in campaign.jobs(only)]:
            try:
                done.result()
            except Wrong as error:
                wrong.append(str(error))
    wrong += [one for campaign in campaigns for one in campaign.wrong]
    for one in wrong:
        print(f'proofs: {one}', file=sys.stderr)
    print(f'proofs: {sum(len(one.proved) for one in campaigns)} proofs, {sum(len(one.refuted) for one in campaigns)} mutants '
          f'refuted, {len(wrong)} wrong, {time.monotonic() - began:.0f} s')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
