"""The demo of tracking."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.sheet import Sheet


def parts() -> dict[str, Sheet | str]:
    """What the command prints."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "demo"
        command = [
            str(Path(sys.executable).with_name("wbc")),
            "track",
            "demo",
            "--no-plots",
            "--no-record",
            "--out",
            str(out),
        ]
        subprocess.run(command, check=True, capture_output=True)
        found = json.loads((out / "summary.json").read_text())
    place, turn, least, meshes = (
        found[key] for key in ("position_error", "rotation_error", "clearance", "mesh_clearance")
    )
    status = found["status"]
    rows = [
        ("position error of the hand", f"{1e3 * place['max']:.3f} mm at most, {1e3 * place['rms']:.3f} mm rms"),
        ("rotation error of the hand", f"{math.degrees(turn['max']):.3f} deg at most"),
        ("elbow plane: commanded and reached", f"up to {found['plane_error']['max']:.2f} rad apart"),
        ("least distance of the link shapes from an obstacle",
         f"{1e3 * least['least']:.2f} mm, for a margin of {1e3 * found['margin']:.0f} mm"),
        ("the same for the description's collision meshes", f"{1e3 * meshes['least']:.2f} mm"),
        ("largest acceleration", f"{found['acceleration']['share']:.3f} of its limit, {found['acceleration']['dof']}"),
        ("ticks relaxed or braked", f"{status['relaxed'] + status['braked']} of {sum(status.values())}"),
    ]  # fmt: skip
    return {"run": Sheet("", ("figure of that run", ""), rows)}
