"""The map of reach: which arm can use a hold, and why none can, of holds that were made for each reason."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from wbc.robots import Walker
from wbc.walking import Hold, Structure
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.report.reach_map import REASONS, save_reach_map, why_unusable
from wbc.walking.run.request import PathRequest
from wbc.walking.run.session import WalkRun

INCH = 0.0254


@pytest.fixture(scope="module")
def path() -> BodyPath:
    return grid_path([(13, 12), (13, 12.5)], 4 * INCH)


def test_every_hold_has_its_arms_or_its_reason(
    machine: Walker, structure: Structure, path: BodyPath, tmp_path: Path
) -> None:
    hold = structure["13,15"]
    turned = [
        Hold(f"turned {k}", hold.pose * pin.SE3(pin.utils.rotate("y", angle), np.zeros(3)))
        for k, angle in enumerate(np.linspace(0.0, np.pi, 25))
    ]
    rng = np.random.default_rng(0)
    near = [
        Hold(f"near {k}", hold.pose * pin.SE3(pin.exp3(rng.uniform(-0.7, 0.7, 3)), rng.uniform(-0.7, 0.7, 3)))
        for k in range(150)
    ]
    above = [
        Hold(f"above {k}", hold.pose * pin.SE3(np.eye(3), np.array([0.0, 0.0, -height])))
        for k, height in enumerate(np.linspace(0.1, 1.1, 12))
    ]
    holds = dataclasses.replace(structure, holds=(*structure.holds, *turned, *near, *above))
    usable, reasons = why_unusable(machine, holds, path)
    told = dict(zip(holds.ids, reasons, strict=True))
    # Either an arm, or a reason
    assert [bool(reason) for reason in reasons] == [not arms for arms in usable.any(axis=1)]
    assert set(reasons) == {"", *REASONS}
    assert told["13,15"] == told["turned 0"] == ""
    assert told["turned 24"] == "faces away"
    assert told["1,1"] == "out of reach"
    # What one arm can use the others cannot where they are too far away
    assert usable[holds.index("13,15")].tolist() == [True, False, False]
    run = WalkRun(PathRequest(), machine, holds, path, None, "refused", "")
    assert save_reach_map(run, tmp_path).stat().st_size > 5000
