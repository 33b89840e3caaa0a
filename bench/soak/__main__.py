"""``python -m bench.soak``: random ticks on random stacks; nothing may fail, and every fall-back is counted.

Ctrl-C ends a run; what was counted until then is printed. The exit status is 1 where anything was wrong.
"""

from __future__ import annotations

import argparse
import logging
import secrets
import sys
import warnings
from collections import Counter
from collections.abc import Iterator

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from bench.records import Parts, Record, measure
from bench.sheet import Sheet
from bench.soak.episodes import stacks
from bench.soak.faults import count, faults
from bench.soak.known import problems

#: Stacks and ticks a stack on the virtual machine; the same compiled; stacks with known problems and problems of each;
#: stacks for the faults
FULL = {"vm": 200, "vm ticks": 240, "native": 20, "native ticks": 47_600, "known": 40, "problems": 25, "faults": 10}

STATUSES = ("solved", "relaxed", "recovered", "braked", "capped")


def parts_of(seed: int, sizes: dict[str, int], native: bool) -> dict[str, tuple[int, Iterator[Record]]]:
    """Part -> (number of records, the records as they come)."""
    n = sizes
    out = {
        f"known {seed}": (n["known"], _records(problems(seed, n["known"], "vm", n["problems"]))),
        f"faults {seed}": (count(n["faults"], native), _records(faults(seed, n["faults"], native))),
        f"vm {seed}": (n["vm"], _records(stacks(seed, n["vm"], "vm", n["vm ticks"]))),
    }
    if native:
        out[f"native {seed}"] = (n["native"], _records(stacks(seed, n["native"], "native", n["native ticks"])))
    return out


def _records(found: Iterator[tuple[str, Counter[str]]]) -> Iterator[Record]:
    for name, counts in found:
        yield {"name": name, "counts": counts}


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
        shares = [f"{ends[s]}" for s in STATUSES]
        links = ", ".join(f"{key} {n}" for key, n in sorted(total.items()) if " by " in key)
        wrong = sum(n for key, n in total.items() if is_wrong(key))
        rows.append((part, f"{len(records)}", f"{ticks}", *shares, links or "-", f"{wrong}"))
    return Sheet("Ticks by how they ended", ("part", "runs", "ticks", *STATUSES, "links taken", "wrong"), rows)


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
    return parser.parse_args(given)


def sizes_of(scale: float, most: int | None) -> dict[str, int]:
    """Sizes of a run."""
    sizes = {name: max(20, int(n * scale)) if "ticks" in name else n for name, n in FULL.items()}
    if most is not None:
        sizes |= {name: min(sizes[name], most) for name in ("vm", "native", "known", "faults")}
    return sizes


def main(given: list[str] | None = None) -> int:
    """Run and print; the exit status."""
    chosen = arguments(given)
    seeds = {chosen.seed: 1.0} if chosen.seed is not None else {0: 1.0, secrets.randbelow(10**9): 0.1}
    work: dict[str, tuple[int, Iterator[Record]]] = {}
    for seed, share in seeds.items():
        work |= parts_of(seed, sizes_of(chosen.scale * share, chosen.stacks), not chosen.vm)
    console, errors = Console(), Console(stderr=True)
    if not console.is_terminal:
        console = Console(width=200)
    bars = (TextColumn("{task.description:18}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    logging.getLogger("wbc").setLevel(logging.ERROR)
    with Progress(*bars, TimeRemainingColumn(), console=errors) as progress, warnings.catch_warnings():
        # targets at 50 m and weights of 1e3 do overflow inside NumPy now and then; what comes out is judged
        warnings.simplefilter("ignore", RuntimeWarning)
        parts, interrupted = measure(work, progress)
    console.print(sheet(parts).rich())
    if interrupted:
        console.print(f"Ended by Ctrl-C in: {interrupted}.", markup=False)
    bad = failures(parts)
    for text in bad:
        console.print(text, markup=False, highlight=False, soft_wrap=True)
    console.print(f"{len(bad)} runs with something wrong.", markup=False)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
