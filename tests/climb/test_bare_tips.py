"""Limbs whose shapes end before the contact's point, as links without collision geometry at their tips do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from wbc.climb import ClimbScene, Foothold, machines
from wbc.climb.clear import Clearances, climber_bodies
from wbc.climb.climber import Climber
from wbc.climb.scene import SceneBody
from wbc.climb.stance import FREE_LIMB
from wbc.shapes import Box


def bare(name: str) -> Climber:
    """A preset without the shapes that its limbs' last joints move."""
    climber = machines.climber(name)
    model, last = climber.robot.model, {chain[-1] for chain in climber.chains}
    shapes = {
        link: group
        for link, group in climber.robot.shapes.items()
        if model.frames[model.getFrameId(link)].parentJoint not in last
    }
    robot = climber.robot.with_self_pairs(None).with_shapes(shapes)
    return replace(climber, robot=machines.ready(robot))


def test_a_point_stands_for_contacts_of_tips_that_tilt_or_have_no_shape() -> None:
    grips = climber_bodies(machines.climber("walker"))
    assert not [body.name for body in grips if body.name.startswith("contact of")]
    for climber in (machines.climber("hexapod"), bare("hexapod")):
        points = [body.name for body in climber_bodies(climber) if body.name.startswith("contact of")]
        assert points == [f"contact of {limb.name}" for limb in climber.limbs]


def test_a_bare_tip_is_kept_out_of_what_it_would_pass_through() -> None:
    climber = bare("hexapod")
    angles = climber.angles(climber.rest, 0)
    ends = [climber.with_limb(climber.rest, 0, angles + turned) for turned in (-0.2 * np.eye(3)[0], 0.2 * np.eye(3)[0])]
    between = climber.contact_pose(climber.rest, 0).translation
    plate = SceneBody(Box((0.004, 0.004, 0.004)), pin.SE3(np.eye(3), between))
    foothold = Foothold("far", pin.SE3(np.eye(3), np.array([100.0, 0.0, 0.0])))
    around = Clearances(climber, ClimbScene([foothold], {"crumb": plate}), clearance=0.001)
    nearest = around.moving([(FREE_LIMB,)] * 6, np.array([0.0, 1.0]), np.stack(ends), None)
    assert nearest is not None
    assert {nearest.first, nearest.second} == {f"contact of {climber.limbs[0].name}", "crumb"}
