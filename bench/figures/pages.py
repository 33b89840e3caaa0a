"""Blocks of pages that are written from files of figures, and numbers that stand in no block."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path

from bench.pool import ROOT

#: ``<!-- figures NAME PART -->`` ... ``<!-- end -->``
BLOCK = re.compile(r"<!-- figures (\S+) (\S+) -->\n.*?<!-- end -->\n", flags=re.DOTALL)
#: The line under a block that says where it comes from, and the block's end
SIGNED = re.compile(r"\n\n\*`[^\n]*\*\n\n<!-- end -->")
#: Parts of a page that are no prose and no table of its own: blocks of figures, code
APART = re.compile(
    r"<!-- figures[^\n]*-->\n.*?<!-- end -->\n|^```.*?^```$|(?:^ {4}[^\n]*\n)+", re.DOTALL | re.MULTILINE
)
#: ``<!-- by FILE ... -->`` before a table: whose numbers these are, tests that hold them or the file that states them
BY = re.compile(r"<!-- by ([^\n]*?) -->\n")
#: A cell of a table that holds nothing but what only a measurement can say: fractions, errors, times, shares
NUMBER = re.compile(r"(?=.*(?:\d\.\d|\de-?\d|us|ms|s|%|mm))[-+]?\d[-+.,e\d ]*(?: ?(?:us|ms|s|min|%|mm))?")
#: The same in a sentence, where numbers may also be what somebody chose: times of processors, and machines
SENTENCE = re.compile(
    r"\d (?:us|µs)\b|\d (?:ms|s) of (?:the )?processor|\d-core|under load|\bbusy machine", re.IGNORECASE
)


def all_pages() -> list[Path]:
    """README and everything in docs."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def rendered(text: str, render: Callable[[str, str], str]) -> str:
    """A page with every block as ``render(figure, part)`` has it; of those of one run the last is signed."""
    out = BLOCK.sub(lambda m: f"<!-- figures {m[1]} {m[2]} -->\n\n{render(m[1], m[2])}\n\n<!-- end -->\n", text)
    for line in set(SIGNED.findall(out)):
        out = out.replace(line, "\n\n<!-- end -->", out.count(line) - 1)
    return out


def loose(text: str) -> Iterator[str]:
    """Rows of tables, and sentences, with measured numbers that stand in no block."""
    kept = APART.sub(lambda m: "\n" * m[0].count("\n"), text)
    held = False
    for n, line in enumerate(kept.splitlines(), 1):
        if BY.fullmatch(line + "\n"):
            held = True
        elif line.startswith("|") or line.lstrip().startswith("| "):
            if not held and any(NUMBER.fullmatch(cell.strip()) for cell in line.split("|")):
                yield f"{n}: {line}"
        else:
            held = held and not line.strip()
            if SENTENCE.search(line):
                yield f"{n}: {line}"


def named(text: str) -> set[str]:
    """Files that the page names as the source of its tables."""
    return {file for files in BY.findall(text) for file in files.split()}
