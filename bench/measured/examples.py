"""What examples print of themselves: measured by Pinocchio and Coal, not by the stack."""

from __future__ import annotations

import subprocess
import sys
from tempfile import TemporaryDirectory

from bench.pool import ROOT
from bench.sheet import Sheet

NAMES = ("clutter", "self_collision", "dual_arm", "mobile_base")


def parts() -> dict[str, Sheet | str]:
    """The lines of each, without the name of the picture."""
    return {name: f"```text\n{said(name)}\n```" for name in NAMES}


def said(name: str) -> str:
    """What an example prints in a folder of its own."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, str(ROOT / "examples" / f"{name}.py")]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return "\n".join(line for line in done.stdout.splitlines() if not line.endswith(".png"))
