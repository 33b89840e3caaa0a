"""Bodies and correspondences are found from trees of points, whatever the names are."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from tests.retarget import clips, motions
from wbc import robots
from wbc.errors import UnknownNameError
from wbc.retarget import BodyError, Correspondence, CorrespondenceError, Skeleton
from wbc.retarget.body import LIMBS, find_body
from wbc.retarget.correspondence import correspondence
from wbc.retarget.robot_body import RobotBody, body_of
from wbc.retarget.words import side_of

HUMANOIDS = {
    "g1": ("left_knee_joint", "left_ankle_pitch_joint", "left_elbow_joint", "left_wrist_pitch_joint"),
    "talos": ("leg_left_4_joint", "leg_left_5_joint", "arm_left_4_joint", "arm_left_6_joint"),
    "icub": ("l_knee", "l_ankle_pitch", "l_elbow", "l_wrist_pitch"),
    "romeo": ("LKneePitch", "LAnklePitch", "LElbowYaw", "LWristYaw"),
    # Its arms point ahead at rest, and none of its files of bodies is there
    "romeo_laas_small": ("LKneePitch_joint", "LAnklePitch_joint", "LElbowYaw_joint", "LWristYaw_joint"),
    "simple_humanoid": ("LLEG_KNEE", "LLEG_ANKLE_P", "LARM_ELBOW", "LARM_WRIST_P"),
    "human": ("left_knee_Z", "left_ankle_Z", "left_elbow_Z", "left_wrist_Z"),
}
QUADRUPEDS = {
    "a1": ("FL_calf_joint", "RL_calf_joint"),
    "anymal_c": ("LF_KFE", "LH_KFE"),
    "solo12": ("FL_KFE", "HL_KFE"),
    "hyq": ("lf_kfe_joint", "lh_kfe_joint"),
}


@functools.cache
def body(name: str) -> RobotBody:
    """Of a robot by name."""
    return body_of(robots.load(name))


def carrier(found: RobotBody, frame: str) -> str:
    """Name of the joint that carries a frame."""
    model = found.robot.model
    return str(model.names[model.frames[model.getFrameId(frame)].parentJoint])


def test_a_leg_goes_on_to_its_foot_and_not_along_the_rods_that_move_it() -> None:
    found = body("cassie")
    for side in ("left", "right"):
        leg = found.limbs[f"{side}_leg"]
        assert carrier(found, leg.end) == f"{side}-foot-op"
        assert carrier(found, leg.middle) == f"{side}-shin-tarsus-joint"
        assert leg.bend == -1.0


@pytest.mark.parametrize("name", HUMANOIDS)
def test_knees_ankles_elbows_and_wrists_of_humanoids(name: str) -> None:
    found = body(name)
    assert found.plan.upright
    assert set(found.limbs) == set(LIMBS)
    leg, arm = found.limbs["left_leg"], found.limbs["left_arm"]
    assert tuple(carrier(found, frame) for frame in (leg.middle, leg.wrist, arm.middle, arm.wrist)) == HUMANOIDS[name]
    assert leg.contact == "flat"
    assert found.limbs["right_leg"].contact == "flat"
    # Left is left of right, and the sole is below the ankle
    left, up = found.axes[:, 1], found.axes[:, 2]
    assert (leg.base - found.limbs["right_leg"].base) @ left > 0.05
    assert (leg.places[2] - leg.places[3]) @ up > 0.02


@pytest.mark.parametrize("name", QUADRUPEDS)
def test_front_and_hind_legs_of_quadrupeds(name: str) -> None:
    found = body(name)
    assert not found.plan.upright
    assert tuple(carrier(found, found.limbs[limb].middle) for limb in ("left_arm", "left_leg")) == QUADRUPEDS[name]
    assert all(limb.contact == "point" and 0.005 < limb.radius < 0.06 for limb in found.limbs.values())


@pytest.mark.parametrize("seed", range(20))
def test_a_person_of_any_proportions_and_any_number_of_vertebrae(seed: int) -> None:
    random = np.random.default_rng(seed)
    scaled = {name: random.uniform(0.8, 1.25) for name in ("Leg", "Foot", "Arm", "Hand", "Spine")}
    vertebrae = int(random.integers(0, 5))
    bones = []
    for name, parent, offset in clips.BONES:
        factor = next((value for key, value in scaled.items() if key in name), 1.0)
        bones.append((name, parent, tuple(factor * x for x in offset)))
        if name == "Spine":
            for k in range(vertebrae):
                bones.append((f"Extra{k}", "Spine" if k == 0 else f"Extra{k - 1}", (0.0, 0.0, 0.04)))
    if vertebrae:
        bones = [(n, f"Extra{vertebrae - 1}" if n == "Spine1" else p, o) for n, p, o in bones]
    made = clips.skeleton(bones, size=float(random.uniform(0.5, 2.0)))
    yaw = random.uniform(-np.pi, np.pi) if seed % 2 else 0.0
    made = replace(made, offsets=made.offsets @ clips.turned(2, yaw).T)
    match = correspondence(body("simple_humanoid"), made if seed % 3 else motions.nameless(made))
    for limb, names in (
        ("left_leg", ("LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeEnd")),
        ("right_arm", ("RightArm", "RightForeArm", "RightHand", "RightHandEnd")),
    ):
        one = match.limbs[limb]
        assert tuple(made.names[k] for k in (one.base, one.middle, one.end, one.tip)) == names
    assert np.allclose(match.axes, clips.turned(2, yaw), atol=1e-6)
    legs = sum(body("simple_humanoid").limbs["left_leg"].lengths)
    rest = made.rest
    one = match.limbs["left_leg"]
    theirs = np.linalg.norm(rest[one.base] - rest[one.middle]) + np.linalg.norm(rest[one.middle] - rest[one.end])
    assert match.scale == pytest.approx(legs / theirs)


def test_a_dog_without_names() -> None:
    plan_of = clips.skeleton(clips.DOG_BONES)
    plan = find_body(motions.nameless(plan_of))
    assert not plan.upright
    assert [plan_of.names[k] for k in plan.limbs["left_leg"]][:2] == ["LeftUpLeg", "LeftLeg"]
    assert [plan_of.names[k] for k in plan.limbs["right_arm"]][:2] == ["RightArm", "RightForeArm"]
    assert np.array_equal(plan.axes, np.eye(3))


def test_a_quadruped_follows_a_person_in_a_trot_or_on_all_fours() -> None:
    person = clips.skeleton(clips.BONES)
    trot = correspondence(body("a1"), person)
    assert {limb: match.source for limb, match in trot.limbs.items()} == {
        "left_leg": "left_leg", "right_leg": "right_leg", "left_arm": "right_leg", "right_arm": "left_leg",
    }  # fmt: skip
    fours = correspondence(body("a1"), person, all_fours=True)
    assert fours.limbs["left_arm"].source == "left_arm"
    dog = correspondence(body("a1"), clips.skeleton(clips.DOG_BONES))
    assert all(match.source == limb for limb, match in dog.limbs.items())


def test_saved_read_and_corrected(tmp_path) -> None:  # type: ignore[no-untyped-def]
    match = correspondence(body("talos"), clips.skeleton(clips.BONES))
    match.save(tmp_path / "match.yaml")
    again = match.read(tmp_path / "match.yaml")
    assert again.limbs == match.limbs
    assert again.scale == pytest.approx(match.scale, rel=1e-5)
    text = (tmp_path / "match.yaml").read_text()
    assert len(text.splitlines()) < 15
    assert 'left_arm: [left_arm, "LeftArm", "LeftForeArm"' in text
    (tmp_path / "other.yaml").write_text(
        "scale: 0.9\nlimbs:\n  left_arm: [left_arm, LeftShoulder, LeftForeArm, LeftHand, LeftHand]\n"
    )
    other = match.read(tmp_path / "other.yaml")
    assert other.scale == 0.9
    assert other.skeleton.names[other.limbs["left_arm"].base] == "LeftShoulder"
    assert other.limbs["right_arm"] == match.limbs["right_arm"]
    assert "LeftForeArm" in str(match)
    assert "arm_left_4_joint" in str(match)
    assert "scale" in str(match)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("limbs:\n  left_arm: [left_arm, LeftArn, LeftForeArm, LeftHand, LeftHand]", UnknownNameError, "LeftArm"),
        ("limbs:\n  left_wing: [left_arm, LeftArm, LeftForeArm, LeftHand, LeftHand]", UnknownNameError, "left_arm"),
        ("limbs:\n  left_arm: [left_arm, LeftArm]", CorrespondenceError, "four points"),
        ("sclae: 1", UnknownNameError, "scale"),
        ("a: [", CorrespondenceError, "YAML"),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path, text: str, error: type[Exception], words: str) -> None:  # type: ignore[no-untyped-def]
    match: Correspondence = correspondence(body("talos"), clips.skeleton(clips.BONES))
    (tmp_path / "bad.yaml").write_text(text)
    with pytest.raises(error, match=words):
        match.read(tmp_path / "bad.yaml")


def test_what_has_no_limbs_is_refused() -> None:
    with pytest.raises(BodyError, match="no limbs to find"):
        body_of(robots.load("panda"))
    with pytest.raises(BodyError, match="base='fixed'"):
        body_of(robots.load("alex_nub_hands", base="floating"))
    with pytest.raises(BodyError, match="planar"):
        body_of(robots.load("simple_humanoid", base="planar"))
    chain = Skeleton(("a", "b", "c"), (-1, 0, 1), np.tile([0.0, 0.0, 0.1], (3, 1)), (False, False, True))
    with pytest.raises(BodyError, match="no two chains"):
        correspondence(body("talos"), chain)


def test_a_clip_without_feet_is_refused() -> None:
    bones = [bone for bone in clips.BONES if not any(part in bone[0] for part in ("Leg", "Foot", "Toe"))]
    with pytest.raises(CorrespondenceError, match="no legs"):
        correspondence(body("talos"), clips.skeleton(bones))
    zero = [(n, p, (0.0, 0.05 * ("Left" in n) - 0.05 * ("Right" in n), 0.0)) if "Leg" in n or "Foot" in n else (n, p, o)
            for n, p, o in clips.BONES]  # fmt: skip
    assert correspondence(body("talos"), clips.skeleton(zero)).scale > 0.0


@pytest.mark.parametrize(
    ("name", "side"),
    [("LeftArm", 1), ("l_hip", 1), ("RLEG_KNEE", -1), ("LLEG_HIP_R", 1), ("FR_calf", -1), ("lf_haa", 1), ("Spine", 0),
     ("arm_right_4_joint", -1), ("LHipJoint", 1), ("roll", 0), ("leg", 0)],
)  # fmt: skip
def test_sides_of_names(name: str, side: int) -> None:
    assert side_of(name) == side
