"""Robots of files that say of no posture that it stands: where they do, and how deep their feet are in the ground."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.repeats import repeats
from tests.robots.files import example
from wbc.climb import Climber, NoStancesError, first_stance
from wbc.climb.clear import TILTED, sunk_tips
from wbc.climb.climber import ClimbLimb
from wbc.climb.contacts import PointFoot
from wbc.climb.machines import climber as preset
from wbc.climb.request import ClimberRequest
from wbc.climb.scene import size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import StanceOptions
from wbc.climb.session import climber_of
from wbc.climb.world import SPARE
from wbc.robot.pairs.distances import Links
from wbc.robots import load
from wbc.shapes import PlacedShape, Sphere

#: Description -> its file, and its feet
FILES = {
    "g1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", "left_ankle_roll_link,right_ankle_roll_link"),
    "go2": ("go2_description/urdf/go2.urdf", "FL_foot,FR_foot,RL_foot,RR_foot"),
    "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", "lf_foot,rf_foot,lh_foot,rh_foot"),
    "solo12": ("solo_description/robots/solo12.urdf", "FL_FOOT,FR_FOOT,HL_FOOT,HR_FOOT"),
    "anymal_b": ("anymal_b_simple_description/robots/anymal.urdf", "LF_FOOT,RF_FOOT,LH_FOOT,RH_FOOT"),
}


@functools.cache
def of_file(name: str, hold: str = "point") -> Climber:
    file, feet = FILES[name]
    return climber_of(ClimberRequest(str(example(file)), limbs=(feet,), hold=hold))


@pytest.mark.parametrize("name", list(FILES)[1:])
def test_a_robot_of_zeros_stands(name: str) -> None:
    climber = of_file(name)
    feet = np.array([climber.contact_pose(climber.rest, limb).translation for limb in range(4)])
    middle = climber.center_of_mass(climber.rest)
    assert np.ptp(feet[:, 2]) < 1e-6
    # Inside the feet by a fifth of how far these are apart, both ways
    for axis in (0, 1):
        low, high = np.sort(feet[:, axis])[[1, 2]]
        assert low + 0.2 * (high - low) < middle[axis] < high - 0.2 * (high - low)
    for limb in range(4):
        low, high = climber.limits[limb]
        angles = climber.angles(climber.rest, limb)
        assert (low + 0.1 < angles).all() and (angles < high - 0.1).all()  # noqa: PT018
        # Away from the end of its reach: it can be lowered and lifted
        rows = climber.robot.jacobian(climber.rest, climber.limbs[limb].frame)[:3, climber.joints(limb)]
        assert np.linalg.svd(rows, compute_uv=False)[-1] > 0.1 * (middle[2] - feet[limb, 2])


@pytest.mark.parametrize("name", ["go2", "hyq"])
def test_it_stands_on_stairs(name: str) -> None:
    """The ball of a foot of go2 is 2 mm beside the foot's frame, and so deeper where the leg leans."""
    climber = of_file(name)
    course = draw("stairs", size_of(climber))
    stance = first_stance(climber, course.scene, placed(climber, course.start))
    assert min(stance.contacts) >= 0


def test_a_refusal_names_the_links_that_touch() -> None:
    """Frames at ankles, in place of soles, are too near the ground for what is about them."""
    climber = of_file("g1", "flat")
    climber = replace(climber, limbs=[ClimbLimb(limb.frame, limb.contact) for limb in climber.limbs])
    course = draw("stairs", size_of(climber))
    with pytest.raises(NoStancesError, match=r"links touch.*; most often \w+_link and floor 1 touch"):
        first_stance(climber, course.scene, placed(climber, course.start))


@pytest.mark.parametrize("name", ["go2", "hyq"])
def test_a_refusal_for_want_of_friction_says_so(name: str) -> None:
    """What is out of reach does not depend on friction. A solver that weighs both at once finds nothing in reach."""
    climber, counts = of_file(name), []
    course = draw("stairs", size_of(climber))
    for friction in (0.03, 0.001):
        with pytest.raises(NoStancesError) as refused:
            first_stance(climber, course.scene, placed(climber, course.start), StanceOptions(friction=friction))
        counts.append(
            {why: int(n) for n, why in re.findall(r"(\d+) (out of reach|not borne|links touch)", str(refused.value))}
        )
    for count in counts:
        assert sum(count.values()) == 400
        assert count["not borne"] > 20
        assert count["out of reach"] == counts[0]["out of reach"] < 20


def test_fingers_that_are_too_near_as_the_file_has_them_are_opened_by_the_joint_that_they_follow(
    tmp_path: Path,
) -> None:
    def link(name: str, form: str, at: str = "0 0 0") -> str:
        inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        form = f'<collision><origin xyz="{at}"/><geometry>{form}</geometry></collision>'
        return f'<link name="{name}"><inertial><mass value="0.2"/>{inertia}</inertial>{form}</link>'

    def joint(name: str, parent: str, xyz: str, axis: str, more: str = "") -> str:
        ends = f'<parent link="{parent}"/><child link="{name}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>'
        limit = '<limit lower="-1.2" upper="1.2" effort="50" velocity="5"/>'
        return f'<joint name="{name}_joint" type="revolute">{ends}{limit}{more}</joint>'

    ball, short = '<sphere radius="0.02"/>', '<sphere radius="0.01"/>'
    parts = [link("body", '<box size="0.2 0.2 0.05"/>')]
    for k, turn in enumerate(2.0 * np.pi * np.arange(3) / 3):
        x, y = np.cos(turn), np.sin(turn)
        legs = ("hip", "body", 0.2, 0.0), ("thigh", f"hip{k}", 0.05, 0.0), ("shin", f"thigh{k}", 0.1, -0.15)
        for name, parent, far, down in legs:
            axis = "0 0 1" if name == "hip" else f"{-y} {x} 0"
            parts += [link(f"{name}{k}", short), joint(f"{name}{k}", parent, f"{far * x} {far * y} {down}", axis)]
        parts += [f'<link name="foot{k}"/><joint name="foot{k}_joint" type="fixed"><parent link="shin{k}"/>']
        parts += [f'<child link="foot{k}"/><origin xyz="0 0 -0.25"/></joint>']
    parts += [link("finger1", ball, "0.08 0.0002 0"), joint("finger1", "body", "0 0.02 0.3", "0 0 1")]
    follows = '<mimic joint="finger1_joint" multiplier="-1"/>'
    parts += [link("finger2", ball, "0.08 -0.0002 0"), joint("finger2", "body", "0 -0.02 0.3", "0 0 1", follows)]
    (tmp_path / "gripping.urdf").write_text(f'<robot name="gripping">{"".join(parts)}</robot>')
    climber = climber_of(ClimberRequest(str(tmp_path / "gripping.urdf"), limbs=("foot0,foot1,foot2",), hold="point"))
    pair = next(pair for pair in climber.robot.self_pairs or () if set(pair) == {"finger1", "finger2"})
    assert Links(climber.robot).place(np.zeros((1, climber.robot.nv))).distance(*pair, 0) < SPARE
    course = draw("stairs", size_of(climber))
    stance = first_stance(climber, course.scene, placed(climber, course.start))
    assert min(stance.contacts) >= 0


def test_postures_that_are_stated_stay() -> None:
    robot = load("anymal_c")
    assert np.array_equal(preset("anymal_c").rest, robot.neutral)
    assert np.array_equal(of_file("go2", "grip").rest, of_file("go2", "grip").robot.neutral)


@pytest.mark.parametrize("seed", range(repeats(8)))
def test_a_tip_is_as_deep_as_its_form_beside_the_contact_makes_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    climber = preset("hexapod")
    limb, robot = climber.limbs[0], climber.robot
    frame = robot.model.frames[robot.model.getFrameId(limb.frame)]
    contact = frame.placement * limb.placement
    at = pin.SE3(np.eye(3), rng.normal(scale=0.01, size=3))
    # Only this one is at the limb's tip
    last = climber.chains[0][-1]
    shapes = {
        link: group
        for link, group in robot.shapes.items()
        if robot.model.frames[robot.model.getFrameId(link)].parentJoint != last
    }
    tipped = robot.with_self_pairs(None).with_shapes(shapes | {limb.frame: (PlacedShape(Sphere(0.02), at),)})
    limbs = [ClimbLimb(one.frame, PointFoot(), one.placement, one.name) for one in climber.limbs]
    allowed = next(tip.sink for tip in sunk_tips(Climber(tipped, limbs))[0] if tip.body.link == limb.frame)
    centre = (frame.placement * at).translation - contact.translation
    leg, deepest = contact.translation / np.linalg.norm(contact.translation), 0.0
    for _ in range(4000):
        # Up: the way to the last joint, tilted by as much as it may be
        about = np.cross(leg, rng.normal(size=3))
        up = pin.exp3(about / np.linalg.norm(about) * np.arccos(TILTED) * np.sqrt(rng.uniform())) @ -leg
        deepest = max(deepest, 0.02 - float(centre @ up))
    assert deepest <= allowed < deepest + 2e-3
