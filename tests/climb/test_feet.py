"""Feet: balls whose centre is the contact's frame, soles found from the shapes of links, and tips without a shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.arriving import arrives
from tests.climb.test_search import check
from tests.distances import coal_distance
from tests.repeats import repeats
from tests.robots.files import example
from wbc.climb import BodyPlace, ClimbLoop, ClimbScene, Foothold, first_stance, machines, plan_climb
from wbc.climb.clear import Clearances, climber_bodies
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import PointFoot
from wbc.climb.request import ClimberRequest
from wbc.climb.scene import SceneBody, size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import StanceOptions, find_stances
from wbc.climb.session import climber_of
from wbc.climb.stance import FREE_LIMB
from wbc.climb.world import ClimbWorld, PostureOutcome
from wbc.errors import RangeError, ShapeError
from wbc.robots.feet import ball_radius, sole_of
from wbc.robots.limbed import limbed
from wbc.shapes import Box, Capsule, PlacedShape, Sphere

#: Frames of humanoids' last links, far from their soles and not along them: file, frames
HUMANOIDS = {
    "g1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", "left_ankle_roll_link,right_ankle_roll_link"),
    "talos": ("talos_data/robots/talos_reduced.urdf", "leg_left_6_link,leg_right_6_link"),
}


def ball_footed(rng: np.random.Generator, name: str = "hexapod") -> Climber:
    """A machine of the table on balls of its own at its tips, each of another size, some legs with none."""
    robot = limbed(name)
    tips = [frame for frame in robot.frame_names if frame.endswith("_tip")]
    # Shins end in a ball as it is: they are cut off before
    short = {link: group for link, group in robot.shapes.items() if not link.endswith("_link3")}
    balls = {
        tip: (PlacedShape(Sphere(float(rng.uniform(0.01, 0.03))), pin.SE3.Identity()),)
        for tip in tips
        if rng.random() > 0.2
    }
    robot = machines.ready(robot.with_self_pairs(None).with_shapes(short | balls))
    return Climber(robot, [machines.point_foot(robot, tip) for tip in tips], name=name)


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_balls_of_any_size_stand_on_their_surface(seed: int) -> None:
    rng = np.random.default_rng([8, seed])
    climber = ball_footed(rng)
    radii = [getattr(limb.contact, "radius", 0.0) for limb in climber.limbs]
    balls = {frame: shapes[0].shape.radius for frame, shapes in climber.robot.shapes.items() if "tip" in frame}  # type: ignore[attr-defined]  # spheres
    assert radii == [balls.get(limb.frame, 0.0) for limb in climber.limbs]
    assert len(set(radii)) > 2
    course = draw("rubble", size_of(climber), seed)
    start = first_stance(climber, course.scene, placed(climber, course.start))
    ahead = climber.body_pose(start.q).translation + 0.15 * size_of(climber) * np.array([1.0, 0.0, 0.0])
    plan = plan_climb(climber, course.scene, start, BodyPlace(ahead))
    model, data, ends = climber.robot.model, climber.robot.model.createData(), list(start.contacts)
    for move in plan.moves:
        ends[move.limb] = move.lands
    for q, held in ((start.q, start.contacts), (plan.q[-1], ends)):
        pin.framesForwardKinematics(model, data, q)
        for limb, row in enumerate(held):
            foothold, at = course.scene.footholds[row], data.oMf[model.getFrameId(climber.limbs[limb].frame)]
            over = foothold.pose.actInv(at.translation)
            assert np.allclose(over, [0.0, 0.0, radii[limb]], atol=1e-6)
            if radii[limb]:
                body = course.scene.bodies[foothold.on]
                near = coal_distance(Sphere(radii[limb]), at, body.shape, body.placement)
                assert -1e-5 < near < 1e-5
    arrives(ClimbLoop(plan, backend="vm").run(), climber, course.scene)


def test_a_ball_bears_what_a_point_under_it_bears() -> None:
    """Forces act where it touches, not at its centre."""
    rng = np.random.default_rng(9)
    climber = ball_footed(rng)
    points = replace(climber, limbs=[ClimbLimb(one.frame, PointFoot(0.6), name=one.name) for one in climber.limbs])
    scene = draw("rubble", size_of(climber), 3).scene
    worlds = [ClimbWorld(each, scene) for each in (climber, points)]
    for _ in range(20):
        rows = rng.choice(len(scene.footholds), 6, replace=False)
        middle = scene.positions[rows].mean(axis=0) + rng.normal(scale=[0.1, 0.1, 0.3], size=3)
        one, other = (world.slack(world.places_of(rows), middle)[0] for world in worlds)
        assert one == pytest.approx(other, abs=1e-9)


def test_a_ball_is_one_about_its_frame() -> None:
    robot = limbed("hexapod")
    # The round end of the shin is about a frame in its middle, and the tip is on its surface
    shin, end = "limb1_link3", robot.shapes["limb1_link3"][0].ends()[1]
    assert ball_radius(robot.with_frame("end", shin, pin.SE3(np.eye(3), end)), "end") == pytest.approx(0.014)
    assert ball_radius(robot, "limb1_tip") == 0.0
    with pytest.raises(RangeError, match=r"PointFoot\.radius"):
        PointFoot(radius=-0.01)


def flat_robot(rng: np.random.Generator, half: np.ndarray, turned: float) -> tuple[Climber, pin.SE3]:
    """A machine whose first leg ends in a box, level where it is at rest, beside any frame; the middle of its sole."""
    robot = limbed("hexapod")
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, robot.neutral)
    sole = pin.SE3(pin.utils.rotate("z", turned), rng.normal(scale=0.05, size=3) - [0.0, 0.0, 1.0])
    frame = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(scale=0.05, size=3))
    joint = data.oMf[model.getFrameId("limb1_link3")]
    robot = robot.with_frame("foot", "limb1_link3", joint.actInv(frame))
    box = PlacedShape(Box(tuple(2.0 * half)), frame.actInv(sole) * pin.SE3(np.eye(3), np.array([0.0, 0.0, half[2]])))
    shapes = {link: group for link, group in robot.shapes.items() if link != "limb1_link3"}
    return robot.with_self_pairs(None).with_shapes(shapes | {"foot": (box,)}), frame.actInv(sole)


@pytest.mark.parametrize("seed", range(repeats(6)))
def test_a_sole_is_found_whatever_the_frame(seed: int) -> None:
    rng = np.random.default_rng([10, seed])
    half, turned = np.array([rng.uniform(0.04, 0.1), rng.uniform(0.02, 0.035), 0.01]), float(rng.uniform(-0.6, 0.6))
    robot, wanted = flat_robot(rng, half, turned)
    found = sole_of(robot, "foot")
    assert np.allclose(found.placement.homogeneous, wanted.homogeneous, atol=1e-6)
    assert np.allclose(found.half_lengths, half[:2], rtol=1e-3)


def test_what_is_no_sole_is_refused_in_numbers() -> None:
    robot, _ = flat_robot(np.random.default_rng(0), np.array([0.05, 0.004, 0.01]), 0.0)
    with pytest.raises(ShapeError, match=r"a rectangle of 100 by 8 mm.*20 mm at least"):
        sole_of(robot, "foot")
    with pytest.raises(ShapeError, match="no collision body moves with this frame"):
        sole_of(robot.with_self_pairs(None).with_shapes({}), "foot")
    with pytest.raises(ShapeError, match="rectangle of"):
        sole_of(
            robot.with_self_pairs(None).with_shapes({"foot": (PlacedShape(Capsule(0.03, 0.1), pin.SE3.Identity()),)}),
            "foot",
        )


@pytest.mark.parametrize("name", HUMANOIDS)
def test_humanoids_of_files_stand_on_their_soles_and_lift_either_foot(name: str) -> None:
    file, feet = HUMANOIDS[name]
    climber = climber_of(ClimberRequest(str(example(file)), limbs=(feet,), hold="flat"))
    course = draw("stairs", size_of(climber))
    stance = first_stance(climber, course.scene, placed(climber, course.start))
    world = ClimbWorld(climber, course.scene, stance, clear=0.01)
    contacts, state = world.contacts(world.start), world.state_of(stance.q)
    for limb in range(2):
        kept = np.where(np.arange(2) == limb, FREE_LIMB, contacts).astype(np.int32)
        outcomes = [world.lift(contacts, kept, 0.02, state, attempt)[0] for attempt in range(4)]
        assert PostureOutcome.STANDS in outcomes


@pytest.mark.parametrize(("name", "family"), [("g1", "stairs"), ("talos", "rubble")])
def test_humanoids_of_files_find_their_stances(name: str, family: str) -> None:
    """With angles at limits of joints, and arms that would be in the way of legs as the file has them."""
    file, feet = HUMANOIDS[name]
    climber = climber_of(ClimberRequest(str(example(file)), limbs=(feet,), hold="flat"))
    course = draw(family, size_of(climber))
    start = first_stance(climber, course.scene, placed(climber, course.start))
    goal = BodyPlace(climber.body_pose(placed(climber, course.goal)).translation)
    check(climber, course.scene, find_stances(climber, course.scene, start, goal, StanceOptions(moves=6000)))


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
