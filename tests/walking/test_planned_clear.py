"""What stands in the way of a body, or of its hands, is named; what is planned among obstacles touches nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from wbc.robots import Walker
from wbc.shapes import Box, Capsule
from wbc.walking import Obstacle, PlaneSurface, Structure, plane
from wbc.walking.body_path import BodyPath, grid_path
from wbc.walking.holds.built_in import grid_pose
from wbc.walking.planner.around import NONE_MET, around
from wbc.walking.planner.plan import NoPlanError
from wbc.walking.planner.planner import plan_walk
from wbc.walking.planner.proof import Proof
from wbc.walking.planner.stances.body import BodySearch
from wbc.walking.planner.swings.move import Move

INCH = 0.0254


def with_obstacle(structure: Structure, shape: Box | Capsule, where: pin.SE3) -> Structure:
    return replace(structure, obstacles=(Obstacle("crate", shape, where),))


@pytest.mark.parametrize(("at", "where"), [(9.0, "beginning"), (13.0, "end")])
def test_a_body_in_somethings_way_is_refused_with_its_name(
    machine: Walker, structure: Structure, at: float, where: str
) -> None:
    there = with_obstacle(structure, Box((0.3, 0.3, 0.3)), grid_pose(13, at, 152 * INCH))
    with pytest.raises(
        NoPlanError, match=f"at its {where} the body is nearer than 31 mm to obstacle crate; over "
    ) as no:
        plan_walk(machine, there, grid_path([(13, 9), (13, 13)], 0.1))
    # Over the hold that it names it is clear
    t, a = map(float, str(no.value).split("; over ")[1].split(" m from")[0].rsplit(",", 1)[0].split(","))
    assert (around(machine, there).bodies(grid_path([(t, a), (13, 11)], 0.1).poses[:1]) == NONE_MET).all()


def test_what_is_in_the_way_of_a_body_ends_grips(machine: Walker, structure: Structure) -> None:
    there = with_obstacle(structure, Capsule(0.05, 0.4), grid_pose(13, 12, 152 * INCH))
    plan = plan_walk(machine, there, grid_path([(13, 9), (13, 15)], 0.1), time_budget=0.0, partial=True)
    assert not plan.complete
    assert "obstacle crate is in the way" in plan.reason


def test_two_holds_are_too_few_for_three_hands(machine: Walker, structure: Structure) -> None:
    few = structure.without(hold for hold in structure.ids if hold not in ("13,9", "14,9"))
    with pytest.raises(NoPlanError) as refused:
        plan_walk(machine, few, grid_path([(13, 9), (13, 10)], 0.1))
    assert "collide" not in str(refused.value)
    assert "reach" in str(refused.value)


def test_no_instant_of_a_plan_touches(machine: Walker, structure: Structure) -> None:
    """Beside a crate; and the same plan is found out where the crate stands in a swing's way."""
    path = grid_path([(13, 9), (13, 15)], 0.1)
    plan = plan_walk(machine, structure, path)
    assert plan.grips is not None
    row, law = plan.regrasps[0], plan.laws[0]
    middle = law.places[len(law.places) // 2]
    found = []
    for where in (middle, middle + 3.0):
        there = with_obstacle(structure, Box((0.05, 0.05, 0.05)), pin.SE3(np.eye(3), where))
        swings = BodySearch(machine, there, path, plan.grips).swings
        names = [arm.name for arm in machine.arms]
        arm = names.index(row.arm)
        lift, land = round(row.lift / path.spacing), round(row.land / path.spacing)
        move = Move(arm, plan.chain[arm][0], plan.chain[arm][1], lift, land, row.duration, row.delay, row.curve)
        found.append(Proof(swings).of_swing(move, law, [chain[0] for chain in plan.chain]))
    assert found[0] is not None
    assert found[0].distance < machine.arm_data.clearance
    assert found[1] is None


def test_holds_that_stand_aslant_are_come_to_straight(machine: Walker) -> None:
    """Along its own axis a hand would be nearer to the surface than it may be as it gets to where it may be near."""
    flat = plane()
    lean = pin.utils.rotate("x", 0.15)
    holds = tuple(
        replace(hold, pose=pin.SE3(lean @ hold.pose.rotation, hold.pose.translation)) for hold in flat.holds[:3]
    )
    there = around(machine, replace(flat, holds=(*holds, *flat.holds[3:])))
    assert isinstance(flat.surface, PlaneSurface)
    np.testing.assert_allclose(there.approaches, np.repeat(flat.axes[3:4], len(flat), axis=0), atol=1e-12)


def test_the_body_is_seen_where_it_is(machine: Walker, structure: Structure) -> None:
    """A ball that comes nearer is met at the distance that is required."""
    there = around(machine, with_obstacle(structure, Capsule(0.05, 1e-6), grid_pose(13, 9, 152 * INCH)))
    poses = np.repeat(grid_path([(13, 9), (13, 9)], 0.1).poses[:1], 60, axis=0)
    # Its axis is along the body's own z axis there
    poses[:, :3, 3] += np.linspace(0.0, 0.4, 60)[:, None] * poses[0, :3, 2]
    met = there.bodies(BodyPath(poses).poses)
    gap = np.linspace(0.0, 0.4, 60) - 0.05 - machine.arm_data.body_half_thickness - there.of_body
    assert (met[gap < -0.01] == 0).all()
    assert (met[gap > 0.01] == NONE_MET).all()
