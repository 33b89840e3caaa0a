"""Hands that have time to spare swing with bounded jerk: ruckig's law, within the limits that the least time keeps."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.arms.puma import ArmKinematics
from wbc.walking.body_path import grid_path
from wbc.walking.planner.eased import ACCELERATION, CHANGE, JERK, RAMP, SPEED, profile_at
from wbc.walking.planner.follow import follow_plan
from wbc.walking.planner.plan import Plan, read_plan
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.swings.law import SwingLaw

INCH = 0.0254


@pytest.fixture(scope="module")
def plan(machine: Walker, structure: Structure) -> Plan:
    return plan_walk(machine, structure, grid_path([(13, 6), (13, 18)], 2 * INCH))


def test_the_law_goes_from_rest_to_rest_with_bounded_jerk() -> None:
    parts = np.linspace(0.0, 1.0, 2001)
    law, gap = profile_at(parts), parts[1]
    assert (law.position[0], law.rate[0], law.acceleration[0]) == (0.0, 0.0, 0.0)
    assert law.position[-1] == pytest.approx(1.0, abs=1e-9)
    assert law.rate[-1] == pytest.approx(0.0, abs=1e-9)
    assert law.acceleration[-1] == pytest.approx(0.0, abs=1e-8)
    # The derivatives are those of the position, and the acceleration nowhere jumps
    assert np.diff(law.position) / gap == pytest.approx((law.rate[1:] + law.rate[:-1]) / 2, abs=JERK * gap**2)
    assert np.abs(np.diff(law.acceleration)).max() <= JERK * gap * (1 + 1e-6)
    assert law.rate.max() == pytest.approx(SPEED)
    assert np.abs(law.acceleration).max() == pytest.approx(ACCELERATION)
    steady = (parts > RAMP) & (parts < 1.0 - RAMP)
    assert law.rate[steady] == pytest.approx(SPEED, abs=1e-9)
    pushing = (parts > CHANGE) & (parts < RAMP - CHANGE)
    assert law.acceleration[pushing] == pytest.approx(ACCELERATION)


def rough(law: SwingLaw) -> int:
    """Rows of a law at which its hand's jerk is more than that of a jerk-limited one of its length and duration."""
    jerk = np.linalg.norm(np.diff(law.places, 3, axis=0), axis=1) / law.spacing**3
    way = np.linalg.norm(np.diff(law.places, axis=0), axis=1).sum()
    return int((jerk > 2.0 * way * JERK / law.duration**3).sum())


def test_a_slow_walk_has_such_swings(plan: Plan) -> None:
    eased = [law for law in plan.laws if law.jerk_limited]
    assert 2 <= len(eased) < len(plan.laws)
    # Where the curve begins and ends to go across its second derivative steps: two rows each
    assert max(rough(law) for law in eased) <= 6
    assert min(rough(law) for law in plan.laws if not law.jerk_limited) > 12
    for step, after in zip(plan.regrasps[:-1], plan.regrasps[1:], strict=True):
        assert step.land <= after.lift
    for step, law in zip(plan.regrasps, plan.laws, strict=True):
        if law.jerk_limited:
            assert law.duration == pytest.approx(step.land - step.lift - 0.24, abs=0.051)


def test_joints_keep_to_their_rates_with_the_body_on_its_way(machine: Walker, plan: Plan) -> None:
    grips, names, used = plan.grips, [arm.name for arm in machine.arms], [0, 0, 0]
    assert grips is not None
    kinematics, spacing, latch = ArmKinematics(machine.arm_data), plan.path.spacing, machine.arm_data.latch_time
    for step, law in zip(plan.regrasps, plan.laws, strict=True):
        arm = names.index(step.arm)
        used[arm] += 1
        if not law.jerk_limited:
            continue
        source, target = plan.chain[arm][used[arm] - 1 : used[arm] + 1]
        count = len(law.places)
        samples = (step.lift + latch + law.spacing * np.arange(count))[None] / spacing
        part = np.array([law.at(k * law.spacing).blend for k in range(count)])[:, None]
        first, last = (grips.between(np.array([[grip]]), samples)[..., 3:5] for grip in (source, target))
        frames = plan.path.blended(samples) @ machine.arms[arm].base.homogeneous
        angles, possible = kinematics.follow(frames, law.places[None], first + part * (last - first), machine.margins)
        assert possible.all()
        rates = np.abs(np.diff(angles[0], axis=0)) / law.spacing / np.array(kinematics.data.joint_rates)[:5]
        assert 0.3 < rates.max() <= machine.margins.swing_rate * 1.02


def test_a_plan_of_a_file_has_the_same_laws(
    machine: Walker, structure: Structure, plan: Plan, tmp_path: pathlib.Path
) -> None:
    again = follow_plan(machine, structure, read_plan(plan.save(tmp_path / "plan.json")))
    assert [law.jerk_limited for law in again.laws] == [law.jerk_limited for law in plan.laws]
    for one, other in zip(again.laws, plan.laws, strict=True):
        assert one.places == pytest.approx(other.places, abs=1e-6)
