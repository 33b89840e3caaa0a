"""Motions keep feet still and limits kept, on robots of any kind; measured here by Pinocchio alone."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.repeats import covering, repeats
from tests.retarget import clips, motions
from wbc import robots
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.multibody import pin
from wbc.retarget import Clip, CorrespondenceError, Retargeted, Retargeter, RetargetOptions, RetargetWeights
from wbc.retarget.mapping import Mapper
from wbc.retarget.retargeter import stances_of
from wbc.retarget.solids import balls_of_joints
from wbc.robot.geometry.link_balls import LinkBalls
from wbc.track.scene import link_meshes

#: Most that a foot in stance slides, and that anything is below the ground [m]
SLIDE, DEPTH = 1e-4, 1e-3


@functools.cache
def retargeter(name: str) -> Retargeter:
    """Of a robot by name, compiled once."""
    return Retargeter(name)


@functools.cache
def motion(robot: str, name: str, start: float = 0.4, end: float = 2.4) -> Retargeted:
    """A part of a clip on a robot."""
    return retargeter(robot).run(motions.part(getattr(clips, name)().clip, start, end))


def check(found: Retargeted, depth: float = DEPTH) -> None:
    """Nothing slides, sinks, breaks a limit or jumps; ``depth``: of links other than feet below the ground [m]."""
    assert np.isfinite(found.q).all()
    assert found.q.shape == (len(found.time), found.robot.nq)
    assert motions.breaches(found) == (0, 0, 0)
    for limb in found.stance:
        assert motions.largest_slide(found, limb) < SLIDE, limb
    figures = found.errors.figures
    assert figures.get("penetration", 0.0) < depth
    for limb, own in found.body.limbs.items():
        if limb.endswith("leg") or not found.body.plan.upright:
            rotations, places = motions.places(found, own.end)
            heights = (rotations[:, 2] @ own.corners.T).min(axis=1) + places[:, 2] - own.radius
            assert heights.min() > -DEPTH, limb
    assert figures["slide"] < SLIDE
    breaches = [figures[f"{what}_breaches"] for what in ("position", "velocity", "acceleration")]
    assert (*breaches, figures["jumps"]) == (0, 0, 0, 0)


def test_a_trunk_that_cannot_be_above_the_ground_is_let_into_it(caplog: pytest.LogCaptureFixture) -> None:
    """The collision body of this one's trunk has a radius of a metre, its legs are 0.7 m long."""
    robot = robots.load("simple_humanoid", base="floating")
    found = Retargeter(robot).run(motions.part(clips.walk().clip, 0.4, 1.4))
    assert "simple_humanoid: its trunk reaches below its soles" in caplog.text
    assert found.errors.mean < 0.06
    assert found.errors.figures["slide"] < SLIDE
    assert motions.breaches(found) == (0, 0, 0)


@pytest.mark.parametrize(("robot", "most"), [("g1", 0.006), ("talos", 0.02), ("icub", 0.02), ("human", 0.006)])
def test_a_walk_on_humanoids(robot: str, most: float) -> None:
    found = motion(robot, "walk")
    check(found)
    assert found.errors.mean < most
    true = clips.walk().stance
    for limb, foot in (("left_leg", "LeftFoot"), ("right_leg", "RightFoot")):
        a = int(0.4 * 60.0)
        assert np.mean(found.stance[limb] == true[foot][a : a + len(found.time)]) > 0.85


@pytest.mark.parametrize(("robot", "name"), covering(["a1", "anymal_c", "solo12"], ["dog", "walk", "crawl"]))
def test_quadrupeds_follow_dogs_and_people(robot: str, name: str) -> None:
    found = motion(robot, name)
    # Thighs of a quadruped whose hips are led as low as a crawling person's
    check(found, depth=3e-3 if name == "crawl" else DEPTH)
    assert found.errors.mean < (1e-3 if name == "walk" else 0.02)
    assert all(marks.mean() > 0.2 for marks in found.stance.values())


@pytest.mark.parametrize("name", ["run", "turn", "jump", "stairs", "sit", "dance"])
def test_every_clip_on_g1(name: str) -> None:
    found = motion("g1", name, 0.5, 2.5)
    check(found)
    assert found.errors.mean < 0.015


def test_soles_do_not_sink_by_the_robot_files_own_bodies() -> None:
    found = motion("talos", "walk")
    robot = found.robot
    bodies = balls_of_joints(robot)
    data = robot.model.createData()
    lowest = np.inf
    for q in found.q:
        pin.forwardKinematics(robot.model, data, q)
        lowest = min(lowest, *(motions.lowest(balls, data.oMi[joint]) for joint, balls in bodies.items()))
    assert -DEPTH < lowest < 0.01


@pytest.mark.parametrize("name", ["g1", "talos", "romeo"])
def test_targets_of_one_who_crawls_lie_on_the_ground_and_not_in_it(name: str) -> None:
    clip = motions.part(clips.crawl().clip, 0.4, 3.4)
    match = Retargeter(name).correspondence(clip.skeleton)
    targets = Mapper(match, clip.rate).targets(clip.points, clip.turns, stances_of(match, clip).ankle)
    for limb, chain in zip(targets.limbs, targets.chains.transpose(1, 2, 0, 3), strict=True):
        lies = match.body.limbs[limb].thickness
        assert chain[1, :, 2].min() > lies[0]
        if limb.endswith("arm"):
            assert (chain[2:, :, 2].min(axis=1) > lies[1:]).all()
            # Bones that are turned are as long as before
            assert np.ptp(np.linalg.norm(np.diff(chain[1:], axis=0), axis=2), axis=1).max() < 1e-12


def test_all_links_of_one_who_crawls_stay_above_ground_as_they_are_drawn() -> None:
    """Rubber hands of a G1 are drawn and have no collision bodies; its feet are on their toes."""
    found = motion("g1", "crawl", 0.4, 3.4)
    data = found.robot.model.createData()
    lowest: dict[str, float] = {}
    for q in found.q:
        pin.framesForwardKinematics(found.robot.model, data, q)
        for link, triangles in link_meshes(found.robot):
            pose = data.oMf[found.robot.model.getFrameId(link)]
            height = float((triangles.reshape(-1, 3) @ pose.rotation[2]).min() + pose.translation[2])
            lowest[link] = min(lowest.get(link, np.inf), height)
    assert min(lowest.values()) > -DEPTH
    assert lowest["left_rubber_hand"] < found.body.limbs["left_arm"].radius
    assert max(found.stance["left_leg"].mean(), found.stance["right_leg"].mean()) > 0.3
    for limb in ("left_leg", "right_leg"):
        rotations, _ = motions.places(found, found.body.limbs[limb].end)
        tilted = found.stance[limb] & (rotations[:, 2, 2] < 0.8)
        assert tilted.any(), limb
    check(found)


def test_hands_rise_where_forearms_would_sink() -> None:
    assert motion("talos", "crawl", 0.4, 3.4).errors.figures["penetration"] < 0.2 * DEPTH


def test_hands_of_a_person_with_noise_do_not_sink() -> None:
    """Noise of 3 mm turns hands by a tenth of a radian a tick."""
    found = retargeter("talos").run(motions.part(clips.noisy(clips.crawl().clip, 0), 0.4, 2.4))
    assert found.errors.figures["penetration"] < DEPTH
    assert motions.breaches(found) == (0, 0, 0)
    assert max(motions.largest_slide(found, limb) for limb in found.stance) < SLIDE


@pytest.mark.parametrize("arm", ["left_arm", "right_arm"])
def test_an_arm_on_the_ground_does_not_roll_from_corner_to_corner(arm: str) -> None:
    """Its forearm and hand have hundreds of corners: with rows for far ones alone it goes round three of them."""
    found = motion("talos", "crawl", 0.4, 3.4)
    joints = [int(found.robot.model.idx_qs[joint]) for joint in found.body.limbs[arm].joints]
    changes = np.diff(found.q[:, joints], 3, axis=0) * found.rate**2
    assert np.sqrt((changes**2).mean()) < 42.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_foot_on_its_toes_is_no_steeper_against_its_shank_than_its_ankle_turns(side: str) -> None:
    found = motion("g1", "crawl", 0.4, 3.4)
    robot, name, plan = found.robot, f"{side}_leg", found.plan
    leg, number = found.body.limbs[name], plan.limbs.index(name)
    knee, ankle, sole = (robot.pose(robot.neutral, frame) for frame in (leg.middle, leg.wrist, leg.end))
    rest = sole.rotation.T @ (knee.translation - ankle.translation)
    shanks = np.einsum("tji,tj->ti", plan.turns[name], plan.chains[:, number, 1] - plan.chains[:, number, 2])
    shanks = shanks[plan.stands[:, number]]
    angles = np.arctan2(rest[0], rest[2]) - np.arctan2(shanks[:, 0], shanks[:, 2])
    hinge = robot.dof_names.index(f"{side}_ankle_pitch_joint")
    assert robot.limits.position_lower[hinge] < angles.min()
    assert angles.max() < robot.limits.position_upper[hinge]


@pytest.mark.parametrize(("name", "kind"), [("g1", "walk"), ("romeo", "crawl"), ("cassie", "walk")])
def test_knees_are_planned_between_hips_and_ankles_where_the_robot_bends(name: str, kind: str) -> None:
    found = motion(name, kind, 0.4, 2.4)
    for limb in ("left_leg", "right_leg"):
        leg, plan, number = found.body.limbs[limb], found.plan, found.plan.limbs.index(limb)
        hip, knee, ankle, _ = np.moveaxis(plan.chains[:, number], 1, 0)
        thighs, shanks = knee - hip, ankle - knee
        # Ends that are out of reach, and knees that lie on the ground, are apart from each other
        near = np.linalg.norm(ankle - hip, axis=1) < 0.99 * sum(leg.lengths)
        near &= knee[:, 2] > leg.thickness[0] + 0.2
        assert near.sum() > 0.3 * len(near) or kind == "crawl"
        assert np.allclose(np.linalg.norm(thighs[near], axis=1), leg.lengths[0], atol=1e-3)
        assert np.allclose(np.linalg.norm(shanks[near], axis=1), leg.lengths[1], atol=1e-3)
        ahead = np.cross(thighs, shanks) * leg.bend
        assert (np.einsum("ti,ti->t", ahead, plan.turns["pelvis"][:, :, 1])[near] > -1e-9).all()
        # Feet are where ankles can hold them
        lean = -np.einsum("tji,tj->ti", plan.turns[limb], shanks)[near & ~plan.stands[:, number]]
        angles = np.arctan2(lean[:, 0], lean[:, 2])
        assert (-angles > leg.pitch[0] - 0.1).all()
        assert (-angles < leg.pitch[1] + 0.1).all()
    assert found.errors.mean < {"g1": 0.002, "romeo": 0.12, "cassie": 0.03}[name]


def test_a_hull_of_few_corners_is_that_of_all() -> None:
    random = np.random.default_rng(5)
    balls = LinkBalls(random.normal(0.0, 0.1, (400, 3)), random.uniform(0.0, 0.02, 400))
    corners = balls.corners(96, 1e-5)
    assert len(corners) <= 96
    for turn in Rotation.random(50, random_state=5).as_matrix():
        pose = pin.SE3(turn, np.zeros(3))
        assert abs(motions.lowest(balls, pose) - float((corners @ turn[2]).min())) < 0.015


def test_stairs_lift_the_feet_by_their_height() -> None:
    found = retargeter("g1").run(clips.stairs().clip)
    _, places = motions.places(found, found.body.limbs["left_leg"].end)
    heights = places[found.stance["left_leg"], 2]
    climbed = clips.stairs().stances["LeftFoot"][-1].pose[2] - clips.stairs().stances["LeftFoot"][0].pose[2]
    scale = retargeter("g1").correspondence(clips.stairs().clip.skeleton).scale
    assert heights[-1] - heights[0] == pytest.approx(scale * climbed, abs=0.01)
    check(found)


def test_points_alone_will_do() -> None:
    whole = motion("g1", "walk")
    found = retargeter("g1").run(motions.pointed(motions.part(clips.walk().clip, 0.4, 2.4)))
    check(found)
    legs = slice(7, 19)
    assert np.abs(found.q[:, legs] - whole.q[:, legs]).mean() < 0.08


@pytest.mark.parametrize(("name", "most"), [("g1", 1.2), ("human", 1.6)])
def test_feet_of_one_who_crawls_are_not_flat_where_ankles_do_not_turn_so_far(name: str, most: float) -> None:
    """Points alone show the feet as tilted by 30 degrees; held flat, they keep the pelvis 18 cm too high."""
    whole = retargeter(name).run(motions.part(clips.crawl(11).clip, 0.0, 2.5))
    found = retargeter(name).run(motions.pointed(motions.part(clips.crawl(11).clip, 0.0, 2.5)))
    check(found)
    assert found.errors.mean < most * whole.errors.mean


def test_another_heading_is_the_same_motion() -> None:
    clip = motions.part(clips.walk().clip, 0.4, 1.4)
    found = retargeter("g1").run(motions.turned(clip, 1.1))
    same = motion("g1", "walk", 0.4, 1.4)
    assert np.abs(found.q[:, 7:] - same.q[:, 7:]).max() < 2e-3


@pytest.mark.parametrize("seed", range(repeats(2)))
def test_people_of_other_sizes_at_other_rates(seed: int) -> None:
    random = np.random.default_rng(seed)
    rate = float(random.choice([15.0, 30.0, 75.0, 240.0]))
    size = float(random.uniform(0.6, 1.8))
    clip = motions.part(clips.walk(seed, rate).clip, 0.4, 2.0)
    skeleton = replace(clip.skeleton, offsets=size * clip.skeleton.offsets)
    if seed % 2:
        skeleton = motions.nameless(skeleton)
    found = retargeter("g1").run(replace(clip, skeleton=skeleton, points=size * clip.points))
    check(found)
    assert found.rate == rate
    assert found.errors.mean < 0.01


def test_the_rate_of_the_motion_may_be_another() -> None:
    clip = motions.part(clips.walk().clip, 0.4, 1.4)
    found = Retargeter("simple_humanoid", options=RetargetOptions(rate=50.0)).run(clip)
    assert found.rate == 50.0
    assert len(found.q) == 51
    assert found.time[-1] == pytest.approx(1.0)
    assert motions.breaches(found) == (0, 0, 0)


def test_what_cannot_be_served_gives_way_and_is_said() -> None:
    """Joints as slow as these cannot run: the motion keeps its limits, and says what it gave up and when."""
    slow = robots.load("g1").with_limits(velocity=2.5)
    found = Retargeter(slow).run(motions.part(clips.run().clip, 0.6, 1.8))
    assert motions.breaches(found) == (0, 0, 0)
    assert found.given_up
    assert all(0.0 <= given.start <= given.end <= 1.3 for given in found.given_up)
    assert any("left_leg" in str(given) or "right_leg" in str(given) for given in found.given_up)
    for limb in found.stance:
        assert motions.largest_slide(found, limb) < SLIDE


def test_arms_of_a_robot_that_stands_fixed() -> None:
    found = Retargeter("alex_nub_hands").run(motions.part(clips.dance().clip, 0.0, 1.5))
    assert motions.breaches(found) == (0, 0, 0)
    assert found.errors.mean < 0.03
    assert not any(marks.any() for marks in found.stance.values())


def test_links_keep_clear_of_each_other() -> None:
    plain, clip = motion("talos", "dance", 0.5, 1.5), motions.part(clips.dance().clip, 0.5, 1.5)
    found = Retargeter("talos", options=RetargetOptions(clearance=0.01)).run(clip)
    pairs = found.robot.self_pairs
    assert pairs
    assert plain.robot.self_pairs != pairs
    assert motions.breaches(found) == (0, 0, 0)


def test_the_pelvis_goes_over_the_feet_for_balance() -> None:
    clip = motions.part(clips.walk().clip, 0.4, 2.0)
    offsets = []
    for weight in (0.0, 200.0):
        found = Retargeter("g1", options=RetargetOptions(balance=weight)).run(clip)
        model = found.robot.model
        off = []
        for k, q in enumerate(found.q):
            mass = pin.centerOfMass(model, model.createData(), q)
            one = [limb for limb in ("left_leg", "right_leg") if found.stance[limb][k]]
            if len(one) == 1:
                _, place = motions.places(replace(found, q=found.q[k : k + 1]), found.body.limbs[one[0]].end)
                off.append(abs(mass[1] - place[0, 1]))
        offsets.append(np.median(off))
    assert offsets[1] < 0.6 * offsets[0]


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        (lambda c: replace(c, points=np.where(np.arange(3) == 2, np.nan, c.points)), NotFiniteError, "Hips at frame 0"),
        (lambda c: replace(c, points=c.points[:, :5]), ShapeError, "expected"),
        (lambda c: replace(c, points=c.points[:0], turns=None), ShapeError, "a frame at least"),
        (lambda c: replace(c, turns=c.turns[:3]), ShapeError, "clip.turns"),
        (lambda c: replace(c, rate=0.0), RangeError, "rate"),
    ],
)
def test_a_clip_that_is_none_is_refused(change, error: type[Exception], words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(error, match=words):
        retargeter("simple_humanoid").run(change(motions.part(clips.walk().clip, 0.0, 0.2)))


def test_bad_options_are_refused() -> None:
    with pytest.raises(RangeError, match=r"options\.acceleration"):
        RetargetOptions(acceleration=0.0)
    with pytest.raises(RangeError, match=r"weights\.foot"):
        RetargetWeights(foot=-1.0)
    with pytest.raises(ShapeError, match="options"):
        Retargeter("simple_humanoid", options={"rate": 3})  # type: ignore[arg-type]
    made = retargeter("simple_humanoid")
    with pytest.raises(CorrespondenceError, match="give a skeleton"):
        made.correspondence()
    other = Retargeter("simple_humanoid", clips.skeleton(clips.DOG_BONES))
    with pytest.raises(CorrespondenceError, match="not those of the skeleton"):
        other.run(motions.part(clips.walk().clip, 0.0, 0.2))


def test_a_clip_of_one_frame_is_a_pose() -> None:
    clip: Clip = motions.part(clips.sit().clip, 0.5, 0.5)
    found = retargeter("g1").run(clip)
    assert found.q.shape == (1, 36)
    assert found.errors.mean < 0.02
