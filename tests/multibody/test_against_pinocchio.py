"""The package's own trees, poses and URDF reader against Pinocchio's, on families that are drawn."""

from __future__ import annotations

import itertools
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.multibody.own import drawn_model, own_model, own_pose
from tests.random_robots import random_inertia, random_pose
from tests.repeats import repeats
from tests.robots.random_urdf import REFUSED, RandomUrdf
from wbc.multibody import own
from wbc.robot.sources.files import captured_stderr
from wbc.robot.sources.urdf_checks import Remarks
from wbc.robot.sources.urdf_model import NotUrdf, UrdfElements, build_model
from wbc.robot.sources.xml_text import parse

ALIKE = 1e-11
REFERENCES = ("WORLD", "LOCAL", "LOCAL_WORLD_ALIGNED")

#: The referee's reader, which nobody else has
REFEREE = pin.buildModelFromXML


def alike(ours: Any, theirs: Any, what: str = "") -> None:
    theirs = np.asarray(theirs)
    largest = max(1.0, float(np.abs(theirs).max(initial=0.0)))
    np.testing.assert_allclose(np.reshape(ours, theirs.shape), theirs, rtol=0.0, atol=ALIKE * largest, err_msg=what)


def near_turns(rng: np.random.Generator) -> np.ndarray:
    """A rotation vector of any size, small ones and nearly half a turn too."""
    turn = rng.normal(size=3)
    size = rng.choice([0.0, 1e-12, 1e-6, 9e-5, 1.1e-4, 9e-4, 1.1e-3, 0.1, 1.0, 3.0, np.pi - 1e-6])
    return turn * size / np.linalg.norm(turn)


@pytest.mark.parametrize("seed", range(repeats(30)))
def test_trees(seed: int) -> None:
    rng = np.random.default_rng(seed)
    theirs = drawn_model(rng)
    ours, q0 = own_model(theirs), pin.neutral(theirs)
    q = pin.integrate(theirs, q0, rng.uniform(-3.0, 3.0, theirs.nv))
    v, a = rng.normal(size=(2, theirs.nv))
    there, here = theirs.createData(), ours.createData()
    alike(own.neutral(ours), q0)
    alike(own.integrate(ours, q, v), pin.integrate(theirs, q, v), "integrate")
    later = pin.integrate(theirs, q, 0.5 * v)
    alike(own.difference(ours, q, later), pin.difference(theirs, q, later), "difference")
    alike(own.normalize(ours, 1.3 * q), pin.normalize(theirs, 1.3 * q), "normalize")
    for off in (0.5e-6, 2e-6):
        assert own.isNormalized(ours, q * (1.0 + off), 1e-6) == pin.isNormalized(theirs, q * (1.0 + off), 1e-6)
    for name, arguments in {
        "rnea": (q, v, a),
        "nonLinearEffects": (q, v),
        "computeGeneralizedGravity": (q,),
        "crba": (q,),
        "aba": (q, v, a),
        "computeCoriolisMatrix": (q, v),
        "centerOfMass": (q,),
        "jacobianCenterOfMass": (q,),
        "computeCentroidalMap": (q,),
        "computePotentialEnergy": (q,),
    }.items():
        found = getattr(own, name)(ours, here, q, *arguments[1:])
        expected = getattr(pin, name)(theirs, there, q, *arguments[1:])
        alike(found, expected, name)
    alike(own.computeCentroidalMomentum(ours, here, q, v).vector, pin.computeCentroidalMomentum(theirs, there, q, v))
    pin.computeJointJacobians(theirs, there, q)
    own.computeJointJacobians(ours, here, q)
    pin.forwardKinematics(theirs, there, q, v, a)
    own.forwardKinematics(ours, here, q, v, a)
    pin.updateFramePlacements(theirs, there)
    own.updateFramePlacements(ours, here)
    for frame in range(len(theirs.frames)):
        alike(here.oMf[frame].homogeneous, there.oMf[frame].homogeneous, "oMf")
        for key in REFERENCES:
            axes = getattr(pin.ReferenceFrame, key), getattr(own.ReferenceFrame, key)
            alike(own.getFrameJacobian(ours, here, frame, axes[1]), pin.getFrameJacobian(theirs, there, frame, axes[0]))
            for name in ("getFrameVelocity", "getFrameAcceleration", "getFrameClassicalAcceleration"):
                found = getattr(own, name)(ours, here, frame, axes[1]).vector
                alike(found, getattr(pin, name)(theirs, there, frame, axes[0]).vector, f"{name} {key}")


@pytest.mark.parametrize("seed", range(repeats(60)))
def test_poses_turns_and_inertias(seed: int) -> None:
    rng = np.random.default_rng(seed)
    twist = np.concatenate([rng.normal(size=3), near_turns(rng)])
    pose, other = pin.exp6(pin.Motion(twist)), random_pose(rng)
    mine, its = own.exp6(twist), own_pose(other)
    alike(mine.homogeneous, pose.homogeneous, "exp6")
    alike(own.log6(own_pose(pose)).vector, pin.log6(pose).vector, "log6")
    alike(own.Jexp3(twist[3:]), pin.Jexp3(twist[3:]), "Jexp3")
    alike(own.exp3(own.log3(pose.rotation)), pose.rotation, "log3")
    alike((mine * its).homogeneous, (pose * other).homogeneous, "product")
    alike(mine.actInv(its).homogeneous, pose.actInv(other).homogeneous, "actInv")
    alike(mine.inverse().action, pose.inverse().action, "action")
    alike(mine.act(own.Motion(twist)).vector, pose.act(pin.Motion(twist)).vector, "act")
    alike(own.SE3ToXYZQUAT(its), pin.SE3ToXYZQUAT(other), "quaternion")
    alike(own.rpy.matrixToRpy(other.rotation), pin.rpy.matrixToRpy(other.rotation), "rpy")
    alike(own.rpy.rpyToMatrix(*twist[:3]), pin.rpy.rpyToMatrix(*twist[:3]), "rpy")
    first, second = rng.normal(size=(2, 3))
    turn = own.Quaternion.FromTwoVectors(first, second).matrix()
    alike(turn, pin.Quaternion.FromTwoVectors(first, second).matrix(), "two vectors")
    alike(own.Quaternion.FromTwoVectors(first, -first).matrix() @ first, -first, "opposite vectors")
    for pair in ((first, 0.0 * first), (0.0 * first, first)):
        ours, theirs = (module.Quaternion.FromTwoVectors(*pair).coeffs() for module in (own, pin))
        alike(ours, theirs, "a vector without a direction")
    bodies = [random_inertia(rng) for _ in range(2)]
    a, b = (own.Inertia(body.mass, body.lever, body.inertia) for body in bodies)
    alike((a + mine.act(b)).matrix(), (bodies[0] + pose.act(bodies[1])).matrix(), "inertia")
    alike(own.Inertia.FromDynamicParameters(a.toDynamicParameters()).matrix(), bodies[0].matrix(), "parameters")
    sizes = rng.uniform(0.1, 2.0, 3)
    for name, count in {"Sphere": 1, "Capsule": 2, "Cylinder": 2, "Box": 3, "Ellipsoid": 3}.items():
        found = getattr(own.Inertia, f"From{name}")(2.0, *sizes[:count])
        alike(found.matrix(), getattr(pin.Inertia, f"From{name}")(2.0, *sizes[:count]).matrix(), name)


def test_steps_about_small_turns_are_exact() -> None:
    """Where Pinocchio's Jexp6 loses digits: against the integral of exp6 by 20 points of Gauss."""
    rng = np.random.default_rng(0)
    points, weights = np.polynomial.legendre.leggauss(20)
    for size in (0.0, 1e-9, 2e-4, 5e-4, 2e-3, 0.04, 0.06, 1.0, 3.0):
        twist = rng.normal(size=6)
        twist[3:] *= size / np.linalg.norm(twist[3:])
        there = (own.exp6(-0.5 * (x + 1.0) * twist).action for x in points)
        integral = sum(0.5 * w * action for w, action in zip(weights, there, strict=True))
        np.testing.assert_allclose(own.Jexp6(twist), integral, rtol=0.0, atol=1e-12)


def read(text: str) -> own.Model | str:
    """The model, or why it is none."""
    try:
        return build_model(UrdfElements(ElementTree.fromstring(text), Remarks("file")), None)  # type: ignore[arg-type]
    except NotUrdf as error:
        return str(error)


def of_urdfdom(text: str) -> tuple[pin.Model | None, str]:
    """(Pinocchio's model of a text, what it said)."""
    try:
        with captured_stderr() as noise:
            model = REFEREE(ElementTree.tostring(ElementTree.fromstring(text), encoding="unicode"))
    except (ValueError, RuntimeError) as error:
        return None, str(error)
    return model, noise.text


def same_tree(ours: pin.Model, theirs: pin.Model) -> None:
    assert list(ours.names) == list(theirs.names)
    assert list(ours.parents) == list(theirs.parents)
    assert [j.shortname() for j in ours.joints[1:]] == [j.shortname() for j in theirs.joints[1:]]
    for a, b in zip(ours.frames, theirs.frames, strict=True):
        assert (a.name, a.parentJoint, a.parentFrame, a.type) == (b.name, b.parentJoint, b.parentFrame, b.type)
        alike(a.placement.homogeneous, b.placement.homogeneous)
    for a, b in zip(ours.jointPlacements, theirs.jointPlacements, strict=True):
        alike(a.homogeneous, b.homogeneous)
    for a, b in zip(ours.inertias, theirs.inertias, strict=True):
        alike(a.matrix(), b.matrix())
    for key in ("lowerPositionLimit", "upperPositionLimit", "upperVelocityLimit", "upperEffortLimit", "damping"):
        np.testing.assert_array_equal(getattr(ours, key), getattr(theirs, key), err_msg=key)
    np.testing.assert_array_equal(ours.upperDryFrictionLimit, theirs.upperDryFrictionLimit)


#: What a number may be replaced by
NOISE = ("", "x", "nan", "inf", "1e400", "1e-400", "0x10", " 2", "2 ", "1_0", "+.5", "3.", "1e", "-7", "1,5", "٣")
CHANGES: dict[str, Callable[[np.random.Generator, str], str]] = {
    "number": lambda rng, text: replaced(rng, text, r'(?<==")[-+0-9.e]+(?=")', str(rng.choice(NOISE))),
    "component": lambda rng, text: replaced(rng, text, r'(?<= )[-+0-9.e]+(?=[ "])', str(rng.choice(NOISE))),
    "attribute": lambda rng, text: replaced(rng, text, r' [a-z]+="[^"]*"(?=[ />])', ""),
    "element": lambda rng, text: replaced(
        rng, text, r"<(mass|inertia|origin|axis|limit|parent|child|mimic) [^<>]*/>", ""
    ),
    "type": lambda rng, text: replaced(
        rng, text, r'(?<=type=")[a-z]+', str(rng.choice(["fixed", "screw", "", "planar"]))
    ),
    "name": lambda rng, text: replaced(rng, text, r'(?<=name=")[^"]*', str(rng.choice(["", "link 1", "joint 1", "é"]))),
    "version": lambda rng, text: text.replace("<robot", f'<robot version="{rng.choice(VERSIONS)}"', 1),
    "quaternion": lambda rng, text: replaced(
        rng, text.replace("<robot", f'<robot version="{rng.choice(VERSIONS[:3])}"', 1), r'rpy="', 'quat_xyzw="0.3 '
    ),
    "extra": lambda rng, text: replaced(rng, text, r"(?=<axis)", str(rng.choice(EXTRAS))),
}
VERSIONS = ("1.0", "1.1", "1.2", "1.3", "2.0", "1", "", "x.y", "+1.0", "01.0", "1.02", "1.0a", "-1.0")
EXTRAS = (
    "<dynamics/>", '<dynamics damping="1"/>', '<dynamics damping="y"/>', "<safety_controller/>",
    '<safety_controller k_velocity="1"/>', '<calibration rising="z"/>', "<calibration/>", "<mimic/>",
    '<dynamics friction="0.5" damping="2"/>', '<mimic joint="joint 1" multiplier="q"/>', '<limit effort="1"/>',
)  # fmt: skip


def replaced(rng: np.random.Generator, text: str, pattern: str, new: str) -> str:
    """A text with one of the places that match replaced."""
    places = list(re.finditer(pattern, text))
    if not places:
        return text
    place = places[int(rng.integers(len(places)))]
    return text[: place.start()] + new + text[place.end() :]


@pytest.mark.parametrize("change", ["none", *CHANGES])
@pytest.mark.parametrize("seed", range(repeats(12)))
def test_files_that_the_reader_takes_and_refuses(seed: int, change: str) -> None:
    """The same verdict as urdfdom's, and the same tree; where an inertial is incomplete urdfdom keeps a part of it."""
    rng = np.random.default_rng([seed, *map(ord, change)])
    made = next(m for k in itertools.count(1000 * seed) if not (m := RandomUrdf(k)).faults.keys() & set(REFUSED))
    text = ElementTree.tostring(parse(made.text().decode("latin-1")), encoding="unicode")
    if change != "none":
        text = CHANGES[change](rng, text)
    ours: Any = read(text)
    theirs, said = of_urdfdom(text)
    if theirs is None:
        # A speed or effort below 0 is taken for none before the model is built
        assert isinstance(ours, str) or "greater than max" in said, text
        return
    assert not isinstance(ours, str), (ours, text)
    if "inertial" not in said:
        same_tree(ours, theirs)
