"""Every field of a ``pin.Model`` survives every way of making a robot of it; a new field of Pinocchio fails here."""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.robots.files import example
from wbc.errors import RangeError
from wbc.multibody.model import OF_COORDINATES, OF_DOFS
from wbc.shapes import Sphere

WHOLE = {"name", "gravity", "referenceConfigurations"}
OF_JOINTS = {"names", "joints", "jointPlacements", "inertias", "parents"}
#: Other names of a field
SAME = {"effortLimit": "upperEffortLimit", "velocityLimit": "upperVelocityLimit", "friction": "upperDryFrictionLimit"}
#: What follows from joints and frames
INDICES = {
    "children", "idx_qs", "idx_vExtendeds", "idx_vs", "mimic_joint_supports", "mimicked_joints", "mimicking_joints",
    "nbodies", "nframes", "njoints", "nq", "nqs", "nv", "nvExtended", "nvExtendeds", "nvs", "span_indexes_vector",
    "sparsity_pattern_vector", "subtrees", "supports",
}  # fmt: skip
CONSTANT = {"gravity981"}
KNOWN = {*WHOLE, *OF_JOINTS, *OF_DOFS, *OF_COORDINATES, *SAME, *INDICES, *CONSTANT, "frames"}


def full_model() -> pin.Model:
    """A tree with two branches, with a value of its own in every field."""
    rng = np.random.default_rng(7)
    model = pin.Model()
    model.name = "full"
    model.gravity = pin.Motion(np.array([0.3, -0.5, -3.7]), np.array([0.1, -0.2, 0.05]))
    model.appendBodyToJoint(0, pin.Inertia.Random(), pin.SE3.Random())
    kinds = [
        ("turn", 0, pin.JointModelRX()),
        ("slide", 1, pin.JointModelPrismaticUnaligned(np.array([0.6, 0.8, 0.0]))),
        ("round", 2, pin.JointModelRUBZ()),
        ("ball", 1, pin.JointModelSpherical()),
        ("last", 4, pin.JointModelRevoluteUnaligned(np.array([0.0, 0.6, -0.8]))),
    ]
    for name, parent, kind in kinds:
        j = model.addJoint(parent, kind, pin.SE3.Random(), name)
        frame = model.addJointFrame(j)
        model.addFrame(pin.Frame(f"{name} link", j, frame, pin.SE3.Random(), pin.FrameType.BODY, pin.Inertia.Random()))
        model.addFrame(pin.Frame(f"{name} eye", j, frame, pin.SE3.Random(), pin.FrameType.SENSOR))
        model.addFrame(pin.Frame(f"{name} weld", j, frame, pin.SE3.Random(), pin.FrameType.FIXED_JOINT))
    for field in OF_DOFS:
        setattr(model, field, rng.uniform(0.5, 2.0, model.nv) * (-1.0 if field.startswith("lower") else 1.0))
    bounded = np.array([True, True, False, False, False, False, False, False, True])
    model.lowerPositionLimit = np.where(bounded, rng.uniform(-2.0, -1.0, model.nq), -1.01)
    model.upperPositionLimit = np.where(bounded, rng.uniform(1.0, 2.0, model.nq), 1.01)
    model.positionLimitMargin = rng.uniform(0.0, 0.1, model.nq)
    for key in ("home", "away"):
        model.referenceConfigurations[key] = pin.randomConfiguration(model)
    return model


def configurations(model: pin.Model) -> dict[str, np.ndarray]:
    return {str(entry.key()): np.array(entry.data()) for entry in model.referenceConfigurations}


def check_fields(out: pin.Model, model: pin.Model, q: np.ndarray, at: np.ndarray) -> None:
    """``out`` at q is ``model`` at ``at``, in all fields of the joints and frames that they share."""
    assert out.name == model.name
    assert out.gravity == model.gravity
    assert set(configurations(out)) == set(configurations(model))
    rows = {"q": ([], []), "v": ([], [])}
    for j in range(1, out.njoints):
        name = str(out.names[j])
        if not model.existJointName(name):
            continue
        k = model.getJointId(name)
        assert out.joints[j].shortname() == model.joints[k].shortname()
        for key, index, size in (("q", "idx_qs", "nqs"), ("v", "idx_vs", "nvs")):
            for side, m, i in ((0, out, j), (1, model, k)):
                start = int(getattr(m, index)[i])
                rows[key][side].extend(range(start, start + int(getattr(m, size)[i])))
    for fields, key in ((OF_DOFS, "v"), (OF_COORDINATES, "q")):
        for field in fields:
            mine, theirs = (np.array(getattr(m, field))[rows[key][side]] for side, m in ((0, out), (1, model)))
            np.testing.assert_array_equal(mine, theirs, err_msg=field)
    for key, values in configurations(model).items():
        np.testing.assert_array_equal(configurations(out)[key][rows["q"][0]], values[rows["q"][1]])
    here, there = out.createData(), model.createData()
    pin.framesForwardKinematics(out, here, q)
    pin.framesForwardKinematics(model, there, at)
    for frame in model.frames:
        if str(frame.name) == "universe":
            continue
        same = [f for f in out.frames if str(f.name) == str(frame.name)]
        assert len(same) == 1, frame.name
        i, k = out.getFrameId(str(frame.name)), model.getFrameId(str(frame.name))
        np.testing.assert_allclose(here.oMf[i].homogeneous, there.oMf[k].homogeneous, atol=1e-12)
        if frame.type == pin.FrameType.JOINT and not out.existJointName(str(frame.name)):
            continue  # what is left of a locked joint
        assert same[0].type == frame.type
        np.testing.assert_array_equal(same[0].inertia.toDynamicParameters(), frame.inertia.toDynamicParameters())
    v, w = rows["v"]
    mass, full = pin.crba(out, here, q), pin.crba(model, there, at)
    np.testing.assert_allclose(np.array(mass)[np.ix_(v, v)], np.array(full)[np.ix_(w, w)], atol=1e-12)
    still, at_rest = (pin.computeGeneralizedGravity(*args) for args in ((out, here, q), (model, there, at)))
    np.testing.assert_allclose(np.array(still)[v], np.array(at_rest)[w], atol=1e-12)


def test_every_field_of_pinocchio_is_known() -> None:
    fields = {name for name in dir(pin.Model) if not name.startswith("__") and not callable(getattr(pin.Model, name))}
    assert fields == KNOWN
    model = full_model()
    for other, name in SAME.items():
        np.testing.assert_array_equal(getattr(model, other), getattr(model, name))
    for name in (*OF_DOFS, *OF_COORDINATES):
        assert len(set(np.array(getattr(model, name)))) > 1, name


@pytest.mark.parametrize("base", [None, "fixed", "floating", "planar", "differential"])
def test_bases_and_pickles(base: str | None) -> None:
    model = full_model()
    robot = wbc.robots.load(model, base=base)
    at = robot.neutral[-model.nq :]
    check_fields(robot.model, model, robot.neutral, at)
    again = pickle.loads(pickle.dumps(robot))
    assert again.model == robot.model
    check_fields(again.model, model, robot.neutral, at)


@pytest.mark.parametrize("base", ["floating", "planar"])
@pytest.mark.parametrize("source", ["file", "mjModel"])
def test_bases_under_files_and_compiled_models(source: str, base: str) -> None:
    what: object = example("talos_data/robots/talos_left_arm.urdf")
    if source == "mjModel":
        what = mujoco.MjModel.from_xml_string(
            '<mujoco><option gravity="0.1 0 -1.62"/><worldbody><body name="arm"><geom size="0.1" mass="2"/>'
            '<joint name="arm" armature="0.3" damping="0.2" frictionloss="0.4" range="-60 60"/>'
            '<body name="hand" pos="0 0 1"><geom size="0.1" pos="0.2 0 0"/><joint name="lift" type="slide"'
            ' armature="0.5" actuatorfrcrange="-7 7"/></body></body></worldbody></mujoco>'
        )
    alone, robot = (wbc.robots.load(what, base=one, shapes="none") for one in ("fixed", base))
    assert any(np.array(getattr(alone.model, name)).any() for name in ("armature", "damping"))
    check_fields(robot.model, alone.model, robot.neutral, alone.neutral)


@pytest.mark.parametrize("base", ["floating", "planar"])
def test_a_base_that_is_taken_away_again(base: str) -> None:
    model = wbc.robots.load(full_model(), base=base).model
    robot = wbc.robots.load(model, base="fixed")
    check_fields(robot.model, model, robot.neutral, np.concatenate([pin.neutral(model)[: -robot.nq], robot.neutral]))


@pytest.mark.parametrize("lock", ["slide", "ball", ["turn", "last"], "round"])
@pytest.mark.parametrize("base", [None, "floating"])
def test_locks(lock: object, base: str | None) -> None:
    model = full_model()
    whole, robot = (wbc.robots.load(model, base=base, lock=one) for one in ((), lock))
    check_fields(robot.model, model, robot.neutral, whole.neutral[-model.nq :])


CHANGES: dict[str, Callable[[wbc.robots.Robot], wbc.robots.Robot]] = {
    "carry": lambda robot: wbc.robots.carry(robot, "box", "last eye", Sphere(0.1)),
    "with_frame": lambda robot: robot.with_frame("tool", "last eye"),
    "with_limits": lambda robot: robot.with_limits(velocity=1.0),
    "with_shapes": lambda robot: robot.with_shapes(
        {"last link": [wbc.shapes.PlacedShape(Sphere(0.1), pin.SE3.Identity())]}
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_changed_robots(change: str) -> None:
    robot = wbc.robots.load(full_model(), base="floating")
    check_fields(CHANGES[change](robot).model, robot.model, robot.neutral, robot.neutral)


@pytest.mark.parametrize("base", [None, "floating"])
def test_a_link_with_the_name_of_its_joint(base: str | None) -> None:
    model = full_model()
    model.frames[model.getFrameId("slide link")].name = "slide"
    for lock in ((), "turn", "slide"):
        robot = wbc.robots.load(model, base=base, lock=lock)
        assert {"slide", "slide_joint"} <= set(robot.frame_names)
        assert ("slide" in robot.joint_names) == (lock != "slide")
        np.testing.assert_array_equal(robot.model.armature[-4:], model.armature[-4:])


@pytest.mark.parametrize("lock", ["panda_finger_joint1", "panda_finger_joint2"])
def test_pinocchios_own_mimic_joints_are_locked_in_pairs(lock: str) -> None:
    model = pin.buildModelFromUrdf(str(example("panda_description/urdf/panda.urdf")), True)
    robot = wbc.robots.load(model, base="floating", lock=lock, neutral={"panda_finger_joint1": 0.02})
    assert (robot.nv, robot.joint_names[-1]) == (13, "panda_joint7")
    width = robot.pose(robot.neutral, "panda_leftfinger", "panda_rightfinger").translation
    assert np.linalg.norm(width) == pytest.approx(0.04, abs=1e-12)


def test_lowered_velocities_do_not_stop_a_lock() -> None:
    model = wbc.robots.load("ur5", shapes="none").model
    model.velocityLimit = np.full(6, 0.5)
    robot = wbc.robots.load(model, lock="elbow_joint", base="floating")
    np.testing.assert_array_equal(robot.limits.velocity[6:], 0.5)


def test_limits_that_differ_by_direction_are_kept_within_the_narrower_and_said(
    caplog: pytest.LogCaptureFixture,
) -> None:
    model = wbc.robots.load("ur5", shapes="none").model
    caplog.clear()
    model.lowerEffortLimit = np.array([-10.0, *model.lowerEffortLimit[1:]])
    model.lowerVelocityLimit = np.array([-0.5, *model.lowerVelocityLimit[1:]])
    robot = wbc.robots.load(model)
    assert (robot.limits.effort[0], robot.limits.velocity[0]) == (10.0, 0.5)
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert said == [
        "the lesser of both directions limits velocity: -0.5 to 3.15 of shoulder_pan_joint",
        "the lesser of both directions limits effort: -10 to 150 of shoulder_pan_joint",
    ]
    model.lowerEffortLimit = np.zeros(6)
    with pytest.raises(RangeError, match="shoulder_pan_joint: expected one below and one above 0"):
        wbc.robots.load(model)


def test_what_a_model_says_of_its_base(caplog: pytest.LogCaptureFixture) -> None:
    model = wbc.robots.load("ur5", base="floating", shapes="none").model
    caplog.clear()
    model.velocityLimit = np.full(12, 2.0)
    model.upperEffortLimit = np.full(12, 3.0)
    model.lowerEffortLimit = np.full(12, -3.0)
    model.upperPositionLimit = np.array([4.0, *model.upperPositionLimit[1:]])
    robot = wbc.robots.load(model)
    assert (robot.limits.velocity == 2.0).all()
    assert np.isinf(robot.limits.effort[:6]).all()
    assert (robot.limits.effort[6:] == 3.0).all()
    said = " ".join(record.getMessage() for record in caplog.records)
    assert "root_joint floats" in said
    assert "-inf to 4" in said


@pytest.mark.parametrize("make", [pin.buildSampleModelManipulator, pin.buildSampleModelHumanoid])
def test_sample_models_of_pinocchio_load(make: Callable[[], pin.Model]) -> None:
    """Their lower efforts are the upper ones, with a positive sign."""
    model = make()
    robot = wbc.robots.load(model)
    np.testing.assert_array_equal(robot.limits.effort[robot.base_nv :], model.upperEffortLimit[robot.base_nv :])
    assert (robot.limits.effort > 0.0).all()
