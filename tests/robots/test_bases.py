"""Fixed, floating, planar and differential bases, from every kind of source."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import placement
from tests.robots.files import DATA
from wbc.errors import RobotFileError, UnknownNameError
from wbc.robots import DHRow

SIZES = {"fixed": (0, 0), "floating": (7, 6), "planar": (4, 3), "differential": (4, 3)}
ROWS = [DHRow(a=0.3), DHRow(a=0.2, joint="prismatic")]


def plain_model() -> pin.Model:
    """A slide and a hinge in series, with a mass welded to the root."""
    model = pin.Model()
    model.appendBodyToJoint(0, pin.Inertia(2.0, np.array([0.1, 0, 0]), 0.01 * np.eye(3)), pin.SE3.Identity())
    first = model.addJoint(0, pin.JointModelPX(), pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.2])), "slide")
    model.addJointFrame(first)
    second = model.addJoint(first, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])), "hinge")
    model.addJointFrame(second)
    model.appendBodyToJoint(second, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", second, 0, pin.SE3(np.eye(3), np.array([0, 0, 0.4])), pin.FrameType.OP_FRAME))
    return model


@pytest.mark.parametrize("base", SIZES)
@pytest.mark.parametrize("source", ["ur5", "model", "dh"])
def test_base_adds_its_degrees_of_freedom(source: str, base: str) -> None:
    what = {"ur5": "ur5", "model": plain_model(), "dh": ROWS}[source]
    alone, robot = wbc.robots.load(what, base="fixed"), wbc.robots.load(what, base=base)
    more_q, more_v = SIZES[base]
    assert (robot.nq, robot.nv, robot.base) == (alone.nq + more_q, alone.nv + more_v, base)
    assert robot.base_nv == more_v
    assert np.isinf(robot.limits.velocity[:more_v]).all()
    assert robot.locked_dofs == ((1,) if base == "differential" else ())
    np.testing.assert_array_equal(robot.limits.position_lower[more_v:], alone.limits.position_lower)
    frame = alone.frame_names[-1]
    poses = []
    for r in (alone, robot):
        poses.append(placement(r, frame, r.neutral).homogeneous)
    np.testing.assert_allclose(poses[1], poses[0], atol=1e-12)


def test_floating_base_carries_what_was_welded_to_the_world() -> None:
    model = plain_model()
    robot = wbc.robots.load(model, base="floating")
    own = model.inertias[0].mass + model.inertias[2].mass
    assert pin.computeTotalMass(robot.model) == pytest.approx(own)
    assert model.nv == 2


def test_differential_and_planar_bases_have_different_fingerprints() -> None:
    a, b = (wbc.robots.load("tiago", base=base, shapes="none") for base in ("planar", "differential"))
    assert a.fingerprint != b.fingerprint
    assert a.dof_names[:3] == b.dof_names[:3] == ("root_joint.x", "root_joint.y", "root_joint.yaw")
    assert a.dof_units[:3] == ("m", "m", "rad")


def test_bad_bases() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'floating'"):
        wbc.robots.load("ur5", base="floatin")
    with pytest.raises(RobotFileError, match="floating base of its own"):
        wbc.robots.load(DATA / "crawler.xml", base="planar")
