#!/usr/bin/env python3
"""Checks that the code blocks of a page are what the tree holds.

usage: check_doc_blocks.py ROOT PAGE | --self-test
A block that opens with ```LANGUAGE file=PATH must stand in ROOT/PATH, line for line and in one piece. Blocks marked
`whole` as well must be the whole file.
"""
import re
import sys
import tempfile
from pathlib import Path

FENCE = re.compile(r"^```(\w+) file=(\S+)( whole)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def faults(root: Path, page: str) -> list[str]:
    text = (root / page).read_text()
    blocks = FENCE.findall(text)
    found = [] if blocks else [f"{page}: no block with file=..."]
    for _, name, whole, block in blocks:
        path = root / name
        if not path.is_file():
            found.append(f"{page}: shows {name}, which does not exist")
            continue
        content = path.read_text()
        shown = content == block if whole else f"\n{block}" in f"\n{content}"
        if not shown:
            what = "is not the whole of" if whole else "does not stand in"
            found.append(f"{page}: this block {what} {name}:\n{block}")
    return found


def self_test() -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "a.cpp").write_text("one\ntwo\nthree\n")
        cases = [
            ("```cpp file=a.cpp whole\none\ntwo\nthree\n```\n", 0),
            ("```cpp file=a.cpp\ntwo\nthree\n```\n", 0),
            ("```cpp file=a.cpp\none\nthree\n```\n", 1),
            ("```cpp file=a.cpp\nwo\n```\n", 1),
            ("```cpp file=a.cpp whole\none\n```\n", 1),
            ("```cpp file=b.cpp\none\n```\n", 1),
            ("no code\n", 1),
        ]
        wrong = []
        for text, expected in cases:
            (root / "page.md").write_text(text)
            if len(faults(root, "page.md")) != expected:
                wrong.append(f"expected {expected} faults in {text!r}")
        return wrong


def main() -> int:
    if sys.argv[1:] == ["--self-test"]:
        problems = self_test()
    elif len(sys.argv) == 3:
        problems = faults(Path(sys.argv[1]), sys.argv[2])
    else:
        print(__doc__, file=sys.stderr)
        return 2
    print("\n".join(problems), file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
