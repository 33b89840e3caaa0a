"""Verdicts of rank analysis, by its command."""

from __future__ import annotations

import json
import resource
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bench.sheet import Sheet

EXACT = (
    ("ssrms", "elbow, beta, gamma"),
    ("ssrms", "elbow, beta, gamma", "--algorithm", "singular_vectors"),
    ("spherical_4r", "alpha, beta"),
    ("spherical_4r", "alpha, beta", "--algorithm", "singular_vectors"),
)
CERTIFIED = (
    ("spdm", "alpha, q1, q7, elbow", "--full"),
    ("spdm", "alpha, q1, q7", "--full"),
    ("ssrms", "elbow, beta, gamma", "--certify"),
    ("ssrms_simplified", "elbow, beta, gamma", "--certify"),
)
TREES = ("elbow, beta, gamma", "elbow, beta, gamma, tip in task", "elbow, q1, q2, q7", "arms alpha")


def parts() -> dict[str, Sheet | str]:
    """Exact verdicts, those of certificates, and those of trees; processor time of the command, its start included."""
    rows = [(shown(case), found["verdict"], found["spent"]) for case in EXACT for found in [analysed(*case)]]
    certified = []
    for case in CERTIFIED:
        found = analysed(*case)
        told = found["certificate"]
        boxes = f"{told['boxes']:.0f} of {', '.join(told['joints'])}" if told["verdict"] == "complete" else ""
        where = " everywhere" if told["everywhere"] else f", eps = {told['eps']:.4f}"
        certified.append((shown(case), found["verdict"], told["verdict"] + where, boxes, found["spent"]))
    trees = [(name, tree["verdict"], tree["spent"]) for name in TREES for tree in [analysed("spdm_on_ssrms", name)]]
    return {
        "exact": Sheet("", ("`wbc analyse`", "verdict", "processor time"), rows),
        "certificates": Sheet("", ("`wbc analyse`", "exact", "certificate", "boxes", "processor time"), certified),
        "trees": Sheet("", ("`wbc analyse spdm_on_ssrms --set`", "verdict", "processor time"), trees),
    }


def shown(case: tuple[str, ...]) -> str:
    """The arguments."""
    robot, name, *options = case
    return " ".join([f'`{robot} --set "{name}"', *options]) + "`"


def analysed(robot: str, name: str, *options: str) -> dict[str, Any]:
    """What the command writes about a set."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "found.json"
        command = [
            str(Path(sys.executable).with_name("wbc")),
            "analyse",
            robot,
            "--set",
            name,
            *options,
            "--json",
            str(file),
        ]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        found: dict[str, Any] = json.loads(file.read_text())["sets"][0]
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return found | {"spent": f"{spent:.1f} s"}
