"""The walks of the two-ended arm, by its command."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.sheet import Sheet

COLUMNS = ("gait", "swings", "time", "planned in", "elbow off its path", "held hand off its hold", "largest joint rate",
           "clearance of the structure", "checker")  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """A row a gait."""
    rows = []
    for gait in ("inchworm", "turnaround"):
        with TemporaryDirectory() as folder:
            out = Path(folder) / gait
            command = ["walk", "--robot", "two-ended", "--gait", gait, "--no-pictures", "--out", str(out)]
            subprocess.run([str(Path(sys.executable).with_name("wbc")), *command], check=True, capture_output=True)
            found = json.loads((out / "summary.json").read_text())
        lengths = (found["body_error"], found["held_hand"], found["structure_clearance"])
        body, hand, clearance = (f"{1e3 * length:.2g} mm" for length in lengths)
        rows.append((gait, str(found["plan"]["regrasps"]), f"{found['duration']:.1f} s", f"{found['plan_time']:.2f} s",
                     body, hand, f"{found['rate']:.3f} of the limit", clearance,
                     "clean" if found["checks"]["ok"] else found["checks"]["violated"]))  # fmt: skip
    return {"gaits": Sheet("", COLUMNS, rows)}
