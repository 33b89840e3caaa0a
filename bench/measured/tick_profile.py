"""Where a tick of Talos goes, counted in instructions, beside that of an earlier commit.

Instructions are the same on a busy machine; how long ticks take is in bench/results.md.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.code.run import build
from bench.pool import ROOT
from bench.prepare import prepare
from bench.problems import load
from bench.sheet import Sheet

#: The commit that the tick is compared with
BEFORE = "5f7bfc6"
PROBLEM = "talos"
#: As the library of a controller is built, and which line an instruction comes from
FLAGS = ("TICK_FLAGS=-O3 -march=native -g", "ROWS_FLAGS=-O1 -fstrict-aliasing -march=native -g")
#: Files of the tick, or functions of the generated rows, by what they do
WORK = {
    "task rows: kinematics, errors, Jacobians": ("wbc_generated_f0", "wbc_generated_f"),
    "curvature of the errors": ("wbc_generated_f1",),
    "H and g from the rows, bounds": ("assemble.h",),
    "factors, inverse, triangular systems": ("factor.h",),
    "errors that a step leaves, gains": ("reach.h",),
    "active set": ("active_set.h", "solve.h", "libdaqp"),
    "certificate": ("certify.h",),
    "certificate in wide arithmetic": ("wide.h",),
    "sines and cosines": ("libm",),
}
REST = "all else"

_EXPORT = (
    "import sys; from pathlib import Path; from bench.problems import load; from bench.worker import build;"
    "build('wbc', load(Path(sys.argv[1]))).export(Path(sys.argv[2]))"
)


def parts() -> dict[str, Sheet | str]:
    """A table with instructions a tick by what they do."""
    if shutil.which("valgrind") is None:
        raise RuntimeError("valgrind is not there, which counts the instructions")
    problems = ROOT / "build" / "bench"
    prepare(problems)
    ticks = load(problems / PROBLEM).ticks
    with tempfile.TemporaryDirectory(prefix="wbc-profile-") as place:
        work = Path(place)
        _run(["git", "worktree", "add", "--detach", str(work / "tree"), BEFORE], ROOT)
        # An editable installation leads to these folders of its own tree, wherever the package is imported from
        for name in ("tasks", "robots"):
            (work / "tree" / "wbc" / name).symlink_to(work / "tree" / name)
        try:
            folders = {"before": _built(work / "before", work / "tree", problems)}
        finally:
            _run(["git", "worktree", "remove", "--force", str(work / "tree")], ROOT)
        folders["now"] = _built(work / "now", ROOT, problems)
        counts = {name: _counted(folder, ticks) for name, folder in folders.items()}
    rows = [(what, *(f"{counts[name][what]:,.0f}" for name in folders)) for what in (*WORK, REST)]
    rows.append(("together", *(f"{sum(counts[name].values()):,.0f}" for name in folders)))
    columns = (f"instructions a tick of {PROBLEM.capitalize()}", f"commit {BEFORE}", "now")
    return {"instructions": Sheet("", columns, rows)}


def _run(command: list[str], folder: Path) -> str:
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout


def _built(work: Path, tree: Path, problems: Path) -> Path:
    """The tick of the sources in a tree, built, with its path beside it."""
    work.mkdir()
    _run([sys.executable, "-c", _EXPORT, str(problems / PROBLEM), str(work)], tree)
    return build(work / "export", work / "built", FLAGS)


def _counted(folder: Path, ticks: int) -> dict[str, float]:
    """Instructions of one tick by what they do; without those of the program that calls it."""
    out, path = folder / "counted", folder.parent / "path.bin"
    _run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", "./cycles", str(path), "1"], folder)
    lines = _run(["callgrind_annotate", "--threshold=100", str(out)], folder)
    counts = dict.fromkeys((*WORK, REST), 0.0)
    for number, place in re.findall(r"^\s*([\d,]+) \([ \d.]+%\)\s+(\S+:\S+.*)$", lines, re.MULTILINE):
        if "cycles.c" in place or re.search(r":(pass|main|empty|nanoseconds|counter|wbc_inputs|wbc_last)\b", place):
            continue
        # A pass to warm up and two that are timed
        counts[_work_of(place)] += int(number.replace(",", "")) / (3.0 * ticks)
    return counts


def _work_of(place: str) -> str:
    """What an instruction of a file and function belongs to."""
    if "wbc_generated_f1" in place:
        return "curvature of the errors"
    if place.startswith("???") and "cycles]" in place:
        return "active set"
    return next((what for what, names in WORK.items() if any(name in place for name in names)), REST)
