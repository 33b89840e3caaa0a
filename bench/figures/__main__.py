"""``python -m bench.figures``: measure again what pages say, and write it into their blocks.

A figure is a file of tables and sentences that one command wrote. Without arguments the figures that take at most
--minutes are measured, one after the other; then all blocks are written. --write only writes the blocks; --list says
what there is, and which figures are older than the code that they measure.
"""

from __future__ import annotations

import argparse
import importlib
import subprocess
import sys

from bench.figures import store
from bench.figures.index import FIGURES, Figure, write_blocks
from bench.pool import ROOT
from wbc.interrupts import obey_interrupts


def measure(figure: Figure) -> None:
    """Run what a figure is made by."""
    if figure.command:
        command = [sys.executable if word == "python" else word for word in figure.command]
        subprocess.run(command, cwd=ROOT, check=True)
        return
    about = store.stamp()
    store.write(figure.path, about, importlib.import_module(f"bench.measured.{figure.name}").parts())


def age(figure: Figure) -> str:
    """Why it is old; empty if the code is that which was measured."""
    if not figure.path.is_file():
        return "never measured"
    commit = store.read(figure.path)["stamp"]["commit"]
    files = store.changed(commit, figure.measures)
    if files is None:
        return f"commit {commit} is not in this clone"
    return f"older than {files[0]}" + (f" and {len(files) - 1} more" if len(files) > 1 else "") if files else ""


def main() -> None:
    """Parse the arguments and run."""
    parser = argparse.ArgumentParser(prog="python -m bench.figures", description=__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=list(FIGURES), help="measure these")
    parser.add_argument("--minutes", type=float, default=5.0, help="measure what takes at most so long; default: 5")
    parser.add_argument("--stale", action="store_true", help="of these, what is older than its code")
    parser.add_argument("--write", action="store_true", help="measure nothing, write the blocks")
    parser.add_argument("--list", action="store_true", help="figures, minutes, commands and ages")
    asked = parser.parse_args()
    if asked.list:
        for figure in FIGURES.values():
            print(f"{figure.name:14} {figure.minutes:5g} min  {figure.told:60} {age(figure)}")
        return
    chosen = [FIGURES[n] for n in asked.only or ()] or [f for f in FIGURES.values() if f.minutes <= asked.minutes]
    chosen = [] if asked.write else [f for f in chosen if not asked.stale or age(f)]
    for figure in chosen:
        if len(chosen) == 1:
            measure(figure)
        else:  # a process each
            print(f"{figure.name} ({figure.minutes:g} min)", file=sys.stderr, flush=True)
            subprocess.run([sys.executable, "-m", "bench.figures", "--only", figure.name], cwd=ROOT, check=True)
    for page in write_blocks():
        print(f"{page} written")


if __name__ == "__main__":
    obey_interrupts()
    main()
