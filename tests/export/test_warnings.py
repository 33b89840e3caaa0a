"""Stacks of which large parts are missing compile without a warning, too."""

from __future__ import annotations

from pathlib import Path

import pytest

import wbc
from tests.export.cases import STRICT, build, run
from tests.repeats import ALL, MORE
from tests.stack import small
from wbc.tasks import EndEffector, JointLimits, Posture

#: Warnings of unset variables need some optimisation; more of it takes twice as long
QUICK = "-O2" if MORE >= ALL else "-O1"


def made(kind: str) -> wbc.Stack:
    stack = wbc.Stack(small.arm(), dt=0.01, calm=kind != "linear")
    if kind == "only rows":
        stack.add(wbc.tasks.FrameVelocityLimit("tip", linear=0.5), name="speed")
    elif kind == "only bounds":
        stack.add(JointLimits(), name="limits")
    elif kind == "only a posture":
        stack.add(Posture(), name="posture")
    else:
        stack.add(EndEffector("tip", kind="position"), name="hand")
        stack.add(Posture(), name="posture")
    return stack


@pytest.mark.parametrize(
    ("kind", "flags"),
    [
        ("only rows", QUICK),
        ("only bounds", QUICK),
        ("only a posture", QUICK),
        ("linear", QUICK),
        ("curved", "-O2"),
    ],
)
def test_parts_that_are_missing_leave_no_warning(kind: str, flags: str, tmp_path: Path) -> None:
    c = made(kind).compile(backend="vm")
    c.reset(small.Q)
    folder = c.export(tmp_path / "out", states=20)
    build(folder, f"TICK_FLAGS={flags}")
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 differ" in done.stdout
