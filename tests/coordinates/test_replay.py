"""Drives by pairs are replayed from their recordings alone, without trust in the file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from wbc import replay
from wbc.coordinates import (
    AxisRows,
    CoordinatePair,
    JointRows,
    OnPlane,
    PairController,
    PlaneAngleRows,
    PointRows,
    parts,
)
from wbc.errors import PicklingError
from wbc.replaying.ticks import _Careful

ARM = parts("spherical_4r").arms[0]


def test_a_drive_is_replayed_from_its_file(tmp_path: Path) -> None:
    """Every kind of coordinate, a switch, and the same commands to the last bit."""
    assert ARM.alpha is not None
    psi, turn = PlaneAngleRows("F3", "F4", "tip", axis="joint3"), AxisRows("F2", (0.0, 0.0, 1.0))
    table = PointRows("tip", OnPlane((0.0, 0.0, 0.1), (0.0, 0.2, 1.0)))
    pairs = [CoordinatePair(ARM.tip, one) for one in (ARM.alpha, psi, turn, JointRows("joint1"))]
    pairs.append(CoordinatePair(ARM.tip, (table, JointRows("joint2")), "table"))
    control = PairController(parts("spherical_4r").robot, pairs, backend="vm")
    q, file = np.array((0.3, 0.5, -0.7, 1.1)), tmp_path / "drive.npz"
    control.reset(q)
    with control.controller.record(file):
        for k in range(12):
            if k == 6:
                control.switch("table", 0.1)
            control.command((0.02, 0.01, 0.0))
            q = q + control.dt * control.step(q).v
    found = replay(file)
    assert found.ticks == 12
    assert (found.differing, found.complete) == (0, True)


def test_only_declarations_are_looked_up() -> None:
    """Controllers, advisers and what else is there are not made by a file."""
    careful = _Careful(io.BytesIO(b""))
    assert careful.find_class("wbc.coordinates.items", "KeepRows").__name__ == "KeepRows"
    for module, name in (
        ("wbc.coordinates.control.pair_controller", "PairController"),
        ("wbc.coordinates.items", "expressions"),
        ("wbc.coordinates.control.pair_stack", "PairStack"),
        ("wbc.coordinates.rows", "coordinates"),
        ("wbc.analysis.certificates.screen", "screen"),
    ):
        with pytest.raises(PicklingError):
            careful.find_class(module, name)
