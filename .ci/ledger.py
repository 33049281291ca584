#!/usr/bin/env python3
"""ledger.py note STAGE SECONDS | ledger.py stale STAGE...

.ci/ledger.csv says when each stage of .ci/run was last green: stage, commit, date, seconds. `note` writes a row; `stale`
prints those of the stages that have no row, or one older than 7 days or 100 commits, each with its seconds if they are known.
"""
import csv
import datetime
import pathlib
import subprocess
import sys

LEDGER = pathlib.Path(__file__).with_name('ledger.csv')
COLUMNS = ('stage', 'commit', 'date', 'seconds')
OLDEST_DAYS, MOST_COMMITS = 7, 100


def git(*arguments: str) -> str:
    return subprocess.run(['git', '-C', LEDGER.parent, *arguments], capture_output=True, text=True, check=False).stdout.strip()


def rows() -> dict[str, dict[str, str]]:
    with LEDGER.open(encoding='utf-8', newline='') as file:
        return {row['stage']: row for row in csv.DictReader(file)}


def note(stage: str, seconds: str, today: datetime.date) -> None:
    kept = rows()
    kept[stage] = dict(zip(COLUMNS, (stage, git('rev-parse', '--short=8', 'HEAD'), today.isoformat(), seconds)))
    with LEDGER.open('w', encoding='utf-8', newline='') as file:
        written = csv.DictWriter(file, COLUMNS, lineterminator='\n')
        written.writeheader()
        written.writerows(row for _, row in sorted(kept.items()))


def is_stale(row: dict[str, str] | None, today: datetime.date) -> bool:
    if row is None or (today - datetime.date.fromisoformat(row['date'])).days > OLDEST_DAYS:
        return True
    since = git('rev-list', '--count', f'{row["commit"]}..HEAD')  # empty: no such commit, as in a shallow clone
    return not since or int(since) > MOST_COMMITS


if __name__ == '__main__':
    what, *names = sys.argv[1:]
    now = datetime.datetime.now(datetime.UTC).date()
    if what == 'note':
        note(*names, now)
    else:
        for name in names:
            if is_stale(row := rows().get(name), now):
                print(name, row['seconds'] if row else '')
