"""The parts of the benchmark that are trials from seeds: each in a process of its own, and the table of what came
out.
"""

from __future__ import annotations

import multiprocessing
import os
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from textwrap import shorten

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.machine import Job, Machine, Record
from bench.walk.trials import PARTS, names, tried
from wbc.interrupts import obey_kill

#: What a trial may take [s]; the file in its folder that has what it printed
LONGEST, OUTPUT = 900.0, "output.txt"
#: Processes that begin with the package already loaded
FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(["bench.walk.trials"])
#: Ends of a walk that did what it was to do, and of one that was refused with a reason
WELL, REFUSED = ("arrived", "time"), ("refused", "hold lost", "HoldLost", "NoPlanError", "late")
CRASHED = ("crash", "error")
#: Letters of a reason that a table has room for
WHY = 200
#: Columns of the tables
COLUMNS = (
    *("", "trials", "arrived", "violate", "violate, 2nd checker", "touch, 2nd", "refused", "no passage", "crashed"),
    *("plan: median, most, s", "real time with planning: median, least", "what"),
)
#: Arms of the published machine
USUAL = 3


def trial_jobs(it: Machine, part: str, count: int, folder: Path) -> list[Job]:
    """Trials of a part, where there are ``count`` structures; their runs are left in the folder."""
    return [Job(name, partial(apart, part, name, folder)) for name in names(part, count)]


def apart(part: str, name: str, folder: Path) -> Record:
    """The record of a trial that ran in a process of its own; one that dies or takes too long is a crash."""
    where = folder / f"{part}-{name.replace(' ', '-')}"
    where.mkdir(parents=True, exist_ok=True)
    (where / OUTPUT).write_text("")
    ours, theirs = FORKS.Pipe(duplex=False)
    process = FORKS.Process(target=_answer, args=(theirs, part, name, where), daemon=True)
    # Every process has one core, and numpy's threads are chosen where it is loaded: in the server
    os.environ["OMP_NUM_THREADS"] = "1"
    process.start()
    theirs.close()
    try:
        if ours.poll(LONGEST):
            found: Record = ours.recv()
            process.join()
            return found
        reason = f"not done after {LONGEST:g} s"
    except EOFError:
        process.join()
        last = ((where / OUTPUT).read_text(errors="replace").splitlines() or [""])[-1]
        reason = f"exit status {process.exitcode}: {last}"
    finally:
        process.kill()
        ours.close()
    return {"trial": name, "outcome": "crash", "reason": reason}


def _answer(to: Connection, part: str, name: str, folder: Path) -> None:
    """Carries out a trial and sends its record."""
    output = os.open(folder / OUTPUT, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(output, stream)
    obey_kill()
    to.send(tried(part, name, folder))


def touching(record: Record, checker: str) -> bool:
    """Whether a checker finds two bodies too near in a walk."""
    return any(text.startswith("clearance") for text in record.get(checker, ()))


def group(record: Record) -> str:
    """The family of a structure; "" of other trials."""
    first, *rest = str(record["trial"]).split()
    return first if rest else ""


def trial_sheet(part: str, records: list[Record]) -> Sheet:
    """Counts a family and a number of arms, then the trials that went wrong, each with its seed."""
    families = {family: [r for r in records if group(r) == family] for family in dict.fromkeys(map(group, records))}
    rows = [*(_counts(family or part, mine) for family, mine in families.items()), *_by_arms(records)]
    for r in records:
        wrong = [*r.get("violations", ())[:1], *r.get("second", ())[:1]]
        if r["outcome"] not in WELL:
            wrong.append(shorten(f"{r['outcome']}: {r['reason']}", WHY, placeholder=" ..."))
        if wrong:
            spent = f"{r['plan_s']:.1f}" if "plan_s" in r else "-"
            rows.append((f"{part} {r['trial']}", *[""] * 8, spent, "", "; ".join(wrong)))
    return Sheet(f"Trials from seeds: {part}", COLUMNS, rows)


def counted_sheet(parts: dict[str, list[Record]]) -> Sheet:
    """Counts of structures by the number of arms, and of each other part."""
    rows = [_counts(part, parts[part]) for part in PARTS if part in parts]
    rows[1:1] = _by_arms(parts.get("structures", []))
    return Sheet("Trials from seeds", COLUMNS[:-1], [row[:-1] for row in rows])


def _by_arms(records: list[Record]) -> list[tuple[str, ...]]:
    """Rows of the numbers of arms, where there are several."""
    numbers = sorted({r["arms"] for r in records if "arms" in r}, key=str)
    return [_counts(_of_arms(n), [r for r in records if r.get("arms") == n]) for n in numbers if len(numbers) > 1]


def _counts(name: str, records: list[Record]) -> tuple[str, ...]:
    """A row of how trials ended."""
    well, refused = ([r for r in records if r["outcome"] in some] for some in (WELL, REFUSED))
    bad, other = ([r for r in well if r.get(checker)] for checker in ("violations", "second"))
    counts = len(records), len(well), len(bad), len(other), sum(touching(r, "second") for r in well)
    refusals = len(refused), sum(impossible(r) for r in refused), sum(r["outcome"] in CRASHED for r in records)
    spent = ranged(sorted(r["plan_s"] for r in records if "plan_s" in r), -1)
    return name, *map(str, (*counts, *refusals)), spent, ranged(sorted(filter(None, map(pace, records))), 0), ""


def _of_arms(number: int | str) -> str:
    return f"{number} arms" if isinstance(number, int) else number


def impossible(record: Record) -> bool:
    """Whether no body passes, proven by the reference."""
    return bool(record.get("reference") == "impossible")


def pace(record: Record) -> float | None:
    """Real time factor of a walk with its planning; None of one that was not walked."""
    spent = record.get("plan_s", 0.0) + record.get("walking_s", 0.0)
    return record["walk_s"] / spent if record.get("walking_s") and record["outcome"] in WELL else None


def _not_walked(records: list[Record]) -> float:
    """Part of trials that did not end well."""
    return 1.0 - sum(r["outcome"] in WELL for r in records) / len(records)


def ranged(numbers: list[float], end: int) -> str:
    """Median and one end of sorted numbers."""
    return f"{numbers[len(numbers) // 2]:.1f}, {numbers[end]:.1f}" if numbers else "-"


def trial_goals(part: str, records: list[Record]) -> list[Goal]:
    """Nothing that was carried out violates, by either checker, however it ended, and nothing crashes; of structures
    nearly all are walked that the reference does not prove impossible, and plans are made in time.
    """
    well, walked = [r for r in records if r["outcome"] in WELL], [r for r in records if "violations" in r]
    bad = sum(bool(r["violations"] or r["second"]) for r in walked)
    crashed = sum(r["outcome"] in CRASHED for r in records)
    out = [
        Goal(f"{part}: walks of {len(walked)} that were carried out and violate", bad, 0, ""),
        Goal(f"{part}: trials of {len(records)} that crash", crashed, 0, ""),
    ]
    open_ = [r for r in records if not impossible(r)]
    if part == "structures" and open_:
        paces = sorted(filter(None, map(pace, well)))
        usual = [r for r in open_ if r.get("arms", USUAL) == USUAL]
        more = [r for r in open_ if r.get("arms", USUAL) != USUAL]
        longest = max((r["plan_s"] for r in records if "plan_s" in r), default=0.0)
        out += [
            *(
                Goal(f"structures that may be possible and are not walked, {who}", _not_walked(some), 0.05, "")
                for who, some in (("three arms", usual), ("four to six", more))
                if some
            ),
            Goal("structures: longest plan or refusal", longest, 15.0, "s"),
        ]
        if paces:
            out.append(
                Goal(
                    "structures: time for a second of walk, with planning, median",
                    1.0 / paces[len(paces) // 2],
                    0.2,
                    "s",
                )
            )
    return out


__all__ = ["PARTS", "counted_sheet", "trial_goals", "trial_jobs", "trial_sheet"]
