"""``python -m bench.fsp``: figures into bench/fsp.json and into the blocks of docs/fsp.md."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import pathlib
import platform
import re
import subprocess
from typing import Any

# One thread: matrices of three rows wake all cores otherwise
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

from bench.fsp import measures  # noqa: E402
from wbc.interrupts import obey_kill  # noqa: E402

ROOT = pathlib.Path(__file__).parents[2]
FILE, PAGE = ROOT / "bench" / "fsp.json", ROOT / "docs" / "fsp.md"


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table of Markdown, numbers to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def blocks(found: dict[str, Any]) -> dict[str, str]:
    """Name of a block of the page -> what stands in it."""
    norms = []
    for one in found["norms"]:
        pairs = [f"{printed:.6f}, {measured:.6f} @{step}" for step, printed, measured in one["pairs"]]
        numbers = [f"{one[key]:.1e}" for key in ("rms", "median", "largest", "miss", "consistent_miss")]
        norms.append([one["run"], str(one["values"]), *numbers[:3], *pairs, *numbers[3:]])
    shown = [row for row in found["generators"] if row["joints"] in (4, 7, 10, 15, 20)]
    made_by = ("orthogonal", "exchange", "exhaustive")
    costs = [
        [str(row["joints"]), str(row["vectors"]), *(f"{row[n]:.0f}, {row[f'{n}_condition']:.0e}" for n in made_by)]
        for row in shown
    ]
    step, paths = found["steps"], found["paths"]
    names = {
        "full_space": "`FullSpace().resolve`, two obstacles and three limits",
        "orthogonal": "orthogonal space, then the closed form, the same constraints",
        "orthogonal_free": "the same without constraints",
        "blocked": "blocked columns, then the closed form, the same constraints",
        "blocked_free": "the same without constraints",
        "two_steps": "blocked columns in two steps, three limits",
        "pseudo_inverse": "`PseudoInverse().resolve`, without constraints",
    }
    obstacle = []
    for one in found["obstacles"]:
        lengths = [f"{1e3 * one[key]:.{digits}f}" for key, digits in (("clearance", 1), ("beyond", 1), ("miss", 3))]
        rest = [f"{one['step']:.3f}", f"{one['milliseconds']:.1f}"]
        obstacle.append([one["method"], "yes" if one["done"] else "no", *lengths, *rest])
    share = [[name, f"{done} of {paths['paths']}"] for name, done in paths["done"].items()]
    made = f"Commit {found['commit']}, {found['machine']}, {found['date']}."
    return {
        "norms": table(
            [
                "run",
                "values",
                "rms",
                "median",
                "largest",
                "first: printed, measured",
                "middle",
                "last",
                "miss [m, rad]",
                "miss, consistent",
            ],
            norms,
        ),
        "generators": table(["joints", "vectors", "orthogonal [us], cond G", "exchange", "exhaustive"], costs),
        "steps": table(["step of 3 x 10", "us"], [[names[k], f"{v:.0f}"] for k, v in step.items()]),
        "obstacles": table(
            [
                "method",
                "done",
                "least clearance [mm]",
                "beyond the limit [mrad]",
                "miss at the end [mm]",
                "longest step [rad]",
                "a step [ms]",
            ],
            obstacle,
        ),
        "paths": table(["way of resolution", "paths done"], share)
        + f"\n\nOne path as a whole: {paths['seconds']:.2f} s.",
        "made": made,
    }


def write(page: pathlib.Path, found: dict[str, Any]) -> None:
    """Put the blocks into a page."""
    text = page.read_text()
    for name, block in blocks(found).items():
        pattern = rf"(<!-- fsp {name} -->\n).*?(<!-- /fsp {name} -->)"
        text, count = re.subn(pattern, lambda m, block=block: f"{m[1]}\n{block}\n\n{m[2]}", text, flags=re.S)
        assert count == 1, name
    page.write_text(text)


def main() -> None:
    """Measure, write the file and the page."""
    parser = argparse.ArgumentParser(prog="bench.fsp", description=__doc__)
    parser.add_argument("--paths", type=int, default=100, help="random paths near limits")
    parser.add_argument("--quick", action="store_true", help="print, write nothing, and 10 paths")
    given = parser.parse_args()
    asked = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    cores = os.cpu_count()
    load = os.getloadavg()[0]
    found = {
        "commit": commit or "unknown",
        "machine": f"{platform.machine()}, {cores} cores, load {load:.1f} when it began, one thread",
        "date": f"{datetime.date.today():%Y-%m-%d}",
        "steps": measures.steps(),
        "generators": measures.generators(),
        "norms": measures.norms(),
        "obstacles": measures.obstacles(),
        "paths": measures.paths(10 if given.quick else given.paths),
    }
    for name, block in blocks(found).items():
        print(f"{name}\n\n{block}\n", flush=True)
    if not given.quick:
        FILE.write_text(json.dumps(found, indent=1) + "\n")
        write(PAGE, found)


if __name__ == "__main__":
    obey_kill()
    main()
