"""``python -m bench.soak``: random ticks on random stacks; nothing may fail, and every fall-back is counted.

Ctrl-C ends a run; what was counted until then is printed. The exit status is 1 where anything was wrong.
"""

from __future__ import annotations

import argparse
import os
import secrets
import sys
from collections import Counter
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from bench.records import Parts
from bench.sheet import Sheet
from bench.soak.jobs import Job, Kept, measure, parts_of
from wbc.interrupts import obey_kill

#: Stacks and ticks a stack on the virtual machine; the same compiled; stacks with known problems and problems of each;
#: stacks for the faults; stacks with strict levels on either back end, and ticks of each (ten times as many compiled);
#: stacks, and as many with levels, on both back ends at once; stacks that command torques on either back end, and ticks
#: of each (two hundred times as many compiled); runs of random calls of the public surface, and calls of every callable
#: in each
FULL = {
    "vm": 200, "vm ticks": 240, "native": 20, "native ticks": 47_600, "known": 40, "problems": 25, "faults": 10,
    "levels": 10, "levels ticks": 200, "both": 10, "both ticks": 200, "torque": 25, "torque ticks": 200,
    "calls": 10, "call rounds": 20,
}  # fmt: skip

STATUSES = ("solved", "relaxed", "recovered", "braked", "capped")


def is_wrong(key: str) -> bool:
    """A count of something that must not be."""
    return key.startswith(("wrong", "raised"))


def sheet(parts: Parts) -> Sheet:
    """Counts of every part."""
    rows = []
    for part, records in parts.items():
        total = sum((record["counts"] for record in records), Counter[str]())
        ends = Counter({s: sum(n for key, n in total.items() if key.split()[0] == s) for s in STATUSES})
        ticks = sum(ends.values())
        shares = [share(ends[s], ticks) for s in STATUSES]
        links = ", ".join(f"{key} {n}" for key, n in sorted(total.items()) if " by " in key)
        wrong = sum(n for key, n in total.items() if is_wrong(key))
        loose = f"{total['loose bound']}, {total['compared']}" if total["loose bound"] else "0"
        rows.append((part, f"{len(records)}", f"{ticks}", *shares, links or "-", loose, f"{wrong}"))
    names = ("part", "runs", "ticks", *STATUSES, "links taken", "bound > 1e-6, of these beside the referee", "wrong")
    return Sheet("Ticks by how they ended", names, rows)


def conflicts(parts: Parts) -> Sheet:
    """What gave way in the ticks of every part: several kinds may in one tick."""
    totals = {part: sum((r["counts"] for r in records), Counter[str]()) for part, records in parts.items()}
    mark = "gave way: "
    kinds = sorted({key for total in totals.values() for key in total if key.startswith(mark)})
    rows = [(part, *(str(total[kind]) for kind in kinds)) for part, total in totals.items()]
    return Sheet("Ticks in which rows of a kind gave way", ("part", *(k.removeprefix(mark) for k in kinds)), rows)


def share(count: int, ticks: int) -> str:
    """A count, and what part of all ticks it is."""
    return f"{count} ({100.0 * count / ticks:.3g} %)" if count else "0"


def failures(parts: Parts) -> list[str]:
    """Every run in which something was wrong, with what and how often."""
    out = []
    for records in parts.values():
        for record in records:
            bad = {key: n for key, n in record["counts"].items() if is_wrong(key)}
            if bad:
                out.append(f"{record['name']}: " + ", ".join(f"{key} ({n})" for key, n in bad.items()))
    return out


def arguments(given: list[str] | None = None) -> argparse.Namespace:
    """What is asked for."""
    parser = argparse.ArgumentParser(prog="make soak", description=__doc__)
    parser.add_argument(
        "--seed", type=int, help="only this seed; default: 0, then a random one with a tenth of the ticks"
    )
    parser.add_argument("--scale", type=float, default=1.0, help="share of the ticks, stacks stay as many")
    parser.add_argument("--stacks", type=int, help="stacks of each kind at most")
    parser.add_argument("--vm", action="store_true", help="only the virtual machine: no compiler is needed")
    parser.add_argument("--parts", nargs="+", help="only parts whose names begin so: known, faults, vm, native, ...")
    parser.add_argument("--keep", type=Path, help="file of the jobs that are done: the same command goes on from there")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown")
    return parser.parse_args(given)


def sizes_of(scale: float, most: int | None) -> dict[str, int]:
    """Sizes of a run."""
    sizes = {name: max(20, int(n * scale)) if "ticks" in name else n for name, n in FULL.items()}
    if most is not None:
        sizes |= {
            name: min(sizes[name], most)
            for name in ("vm", "native", "known", "faults", "levels", "both", "torque", "calls")
        }
    return sizes


def main(given: list[str] | None = None) -> int:
    """Run and print; the exit status."""
    chosen = arguments(given)
    seeds = {chosen.seed: 1.0} if chosen.seed is not None else {0: 1.0, secrets.randbelow(10**9): 0.1}
    work: dict[str, list[Job]] = {}
    for seed, part in seeds.items():
        work |= parts_of(seed, sizes_of(chosen.scale * part, chosen.stacks), not chosen.vm)
    if chosen.parts:
        work = {name: jobs for name, jobs in work.items() if name.startswith(tuple(chosen.parts))}
    console, errors = Console(), Console(stderr=True)
    if not console.is_terminal:
        console = Console(width=200)
    bars = (TextColumn("{task.description:18}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*bars, TimeRemainingColumn(), console=errors) as progress:
        parts, interrupted = measure(work, Kept(chosen.keep), max(1, chosen.processes), progress)
    for table in (sheet(parts), conflicts(parts)):
        console.print(table.markdown() if chosen.markdown else table.rich(), markup=False, soft_wrap=chosen.markdown)
    if interrupted:
        console.print(f"Ended by Ctrl-C in: {interrupted}.", markup=False)
    bad = failures(parts)
    for text in bad:
        console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print(f"{len(bad)} runs with something wrong.", markup=False)
    return 1 if bad else 0


if __name__ == "__main__":
    obey_kill()
    sys.exit(main())
