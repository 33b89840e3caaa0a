"""Arms that operators command by hand: chains, URDF, shapes, and loading by name."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

import wbc
from tests.models import placement
from tests.refusals import assert_refused
from wbc import errors
from wbc.multibody import mass_matrix
from wbc.robots import operator_arm
from wbc.robots.operator_arms import OPERATOR_ARMS

JOINTS = {"planar_rp": 2, "planar_3r": 3, "spherical_4r": 4, "spdm": 15, "spdm_on_ssrms": 22}


@pytest.mark.parametrize("name", OPERATOR_ARMS)
def test_loads_by_name_and_comes_back_out_of_its_urdf(name: str, tmp_path: pathlib.Path) -> None:
    made, loaded = operator_arm(name), wbc.robots.load(name)
    assert made.robot.nv == loaded.nv == JOINTS.get(name, 7)
    assert made.robot.joint_names == loaded.joint_names
    assert made.robot.shapes.keys() == loaded.shapes.keys()
    assert made.origin == made.robot.notes["origin"]
    read = wbc.robots.load(made.urdf(tmp_path / "arm.urdf"))
    assert sorted(read.joint_names) == sorted(made.robot.joint_names)
    rng = np.random.default_rng(4)
    angle = {joint: rng.uniform(0.0, 1.0) for joint in made.robot.joint_names}
    poses, masses = [], []
    for robot in (made.robot, read):
        q = np.array([angle[joint] for joint in robot.joint_names])
        order = [robot.joint_names.index(joint) for joint in angle]
        poses.append(placement(robot, made.robot.frames["tip"], q).homogeneous)
        masses.append(mass_matrix(robot.model, robot.model.createData(), q)[np.ix_(order, order)])
        for joint in robot.joint_names:
            assert np.isfinite(robot.limits.velocity[robot.dofs(joint)]).all()
    np.testing.assert_allclose(poses[0], poses[1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(masses[0], masses[1], rtol=1e-9, atol=1e-9 * np.abs(masses[0]).max())
    for key in ("position_lower", "position_upper", "velocity", "effort"):
        for joint in angle:
            sides = [getattr(r.limits, key)[r.dofs(joint)] for r in (made.robot, read)]
            np.testing.assert_allclose(sides[0], sides[1], rtol=1e-12)


def test_masses_of_the_space_station_arms() -> None:
    """What is published in all; every link is a body, and the model of the URDF weighs the same everywhere."""
    arm = wbc.robots.load("ssrms")
    masses = [body.mass for body in arm.model.inertias][1:]
    # With the base's own 243.66 kg within 1 % of the 1497 kg that the Canadian Space Agency gives
    assert sum(masses) + 243.66 == pytest.approx(1497.0, rel=0.01)
    assert sum(body.mass for body in wbc.robots.load("spdm").model.inertias) == pytest.approx(1662.0, rel=1e-3)
    for name in ("ssrms", "spdm_arm", "spdm", "spdm_on_ssrms"):
        robot = wbc.robots.load(name)
        assert not robot.model.gravity.linear.any()
        for body in list(robot.model.inertias)[1:]:
            assert body.mass == 0.0 or np.linalg.eigvalsh(np.array(body.toPseudoInertia().toMatrix())).min() > 0.0
        q = np.random.default_rng(5).uniform(-1.0, 1.0, robot.nv)
        M = mass_matrix(robot.model, robot.model.createData(), q)
        assert np.linalg.eigvalsh(M).min() > 0.1


def test_bad_names() -> None:
    assert_refused(lambda: operator_arm("ssrm"), errors.UnknownNameError, "ssrms")
    assert_refused(lambda: wbc.robots.load("spdm_arms"), errors.UnknownNameError, "spdm_arm")
