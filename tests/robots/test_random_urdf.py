"""Random URDF files against their own meaning: poses, masses, energies, limits, couplings, what is said of faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.repeats import repeats
from tests.robots.random_urdf import REFUSED, SAID, SINGLE, RandomUrdf
from wbc.errors import RobotFileError, WbcError

SEEDS = repeats(150)
BASES = (None, None, "fixed", "floating", "planar", "differential")


def numbers_of(robot: wbc.robots.Robot, made: RandomUrdf, q: np.ndarray) -> dict[str, np.ndarray]:
    """Joint -> its numbers in q, of followers of fixed joints where they stand."""
    out, model = {}, robot.model
    for joint in made.joints:
        coupled = made.coupling(joint)
        if model.existJointName(joint.name):
            j = model.getJointId(joint.name)
            out[joint.name] = q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]]
        elif coupled and coupled[0] == "":
            out[joint.name] = np.array([coupled[2]])
    return out


def root_pose(robot: wbc.robots.Robot, made: RandomUrdf, q: np.ndarray) -> np.ndarray:
    """Where a base that the file does not have puts its root."""
    return robot.pose(q, made.links[0].name).homogeneous if robot.joint_names[:1] == ("root_joint",) else np.eye(4)


def check_motion(robot: wbc.robots.Robot, made: RandomUrdf, rng: np.random.Generator) -> None:
    """Poses of all links, masses, and the energy of a motion from the links' own numbers."""
    q = robot.random(rng)
    v = rng.normal(size=robot.nv)
    step = 1e-5
    at = [robot.integrate(q, v, s) for s in (-step, 0.0, step)]
    poses = [[root_pose(robot, made, x) @ p for p in made.poses(numbers_of(robot, made, x))] for x in at]
    for link, pose in zip(made.links, poses[1], strict=True):
        np.testing.assert_allclose(robot.pose(q, link.name).homogeneous, pose, atol=1e-12)
    energy, mass, model = 0.0, 0.0, robot.model
    for k, link in enumerate(made.links):
        if model.frames[model.getFrameId(link.name)].parentJoint == 0:
            continue
        before, now, after = (x[k] for x in poses)
        centre = np.append(link.xyz, 1.0)
        speed = ((after - before) @ centre / (2 * step))[:3]
        rate = pin.log3(after[:3, :3] @ before[:3, :3].T) / (2 * step)
        turn = now[:3, :3] @ pin.rpy.rpyToMatrix(link.rpy)
        energy += (link.mass * speed @ speed + rate @ turn @ link.inertia @ turn.T @ rate) / 2
        mass += link.mass
    data = model.createData()
    assert pin.computeTotalMass(model) == pytest.approx(mass, abs=1e-12)
    assert v @ np.array(pin.crba(model, data, q)) @ v / 2 == pytest.approx(energy, rel=1e-6, abs=1e-9)


def check_limits(robot: wbc.robots.Robot, made: RandomUrdf) -> None:
    found = {
        robot.dof_names[c.follower]: (robot.dof_names[c.leader], pytest.approx(c.ratio), pytest.approx(c.offset))
        for c in robot.couplings
    }
    wanted = {}
    for joint in made.joints:
        coupled = made.coupling(joint)
        if coupled and coupled[0]:
            wanted[joint.name] = coupled
        if joint.kind not in SINGLE or joint.name not in robot.joint_names:
            continue
        dof, limits = robot.dofs(joint.name).start, joint.limits
        low, high = limits.get("lower", -np.inf), limits.get("upper", np.inf)
        if joint.kind == "continuous" or low > high:
            low, high = -np.inf, np.inf
        assert (robot.limits.position_lower[dof], robot.limits.position_upper[dof]) == (low, high)
        for key in ("effort", "velocity"):
            size = limits.get(key, np.inf)
            assert getattr(robot.limits, key)[dof] == (size if size > 0.0 else np.inf)
    assert found == wanted


@pytest.mark.parametrize("seed", range(0, SEEDS, 25))
def test_random_files(seed: int, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for k in range(seed, min(seed + 25, SEEDS)):
        made = RandomUrdf(k)
        path = tmp_path / f"random{k}.urdf"
        path.write_bytes(made.text())
        rng = np.random.default_rng(k)
        base = BASES[rng.integers(len(BASES))]
        wanted, refused = made.base(base), [fault for fault in made.faults if fault in REFUSED]
        caplog.clear()
        if refused or not wanted:
            with pytest.raises(WbcError) as caught:
                wbc.robots.load(path, base=base)
            assert str(path) in str(caught.value)
            if refused and wanted:
                told = [all(word in str(caught.value) for word in made.faults[fault]) for fault in refused]
                assert any(told), (k, str(caught.value), made.faults)
            continue
        robot = wbc.robots.load(path, base=base)
        assert robot.base == wanted, k
        said = [record.getMessage() for record in caplog.records]
        for fault, words in made.faults.items():
            if not any(str(path) in line and all(word in line for word in words) for line in said):
                pytest.fail(f"seed {k}: nothing said of {fault} {words}: {said}")
        if not made.faults:
            harmless = ("has no axis", "nothing drives", "which follows it")
            assert all(any(words in line for words in harmless) for line in said), (k, said)
        try:
            check_limits(robot, made)
            check_motion(robot, made, rng)
        except AssertionError as error:
            raise AssertionError(f"seed {k}, {made.odd!r}, {made.faults}") from error


def test_the_family_has_every_fault_and_base() -> None:
    family = [RandomUrdf(k) for k in range(250)]
    assert {fault for made in family for fault in made.faults} == {*REFUSED, *SAID}
    assert {made.base(None) for made in family} == {"fixed", "floating", "planar"}
    assert any(not made.base("floating") for made in family)
    coupled = [
        made.coupling(joint)
        for made in family
        if not made.faults
        for joint in made.joints
        if joint.kind == "continuous"
    ]
    assert sum(one is not None for one in coupled) > 5


def test_no_entity_is_expanded(tmp_path: Path) -> None:
    path = tmp_path / "entities.urdf"
    for what in ('"b"', 'SYSTEM "file:///etc/hostname"'):
        path.write_text(f'<!DOCTYPE robot [<!ENTITY a {what}>]><robot name="&a;"><link name="x"/></robot>')
        assert wbc.robots.load(path).model.name == "&a;"


def test_depth_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "deep.urdf"
    joint = '<link name="y"/><joint name="j" type="continuous"><parent link="x"/><child link="y"/>{}</joint>'
    deep = f"<robot name='r'>{joint.format('<a>' * 5000 + '</a>' * 5000)}<link name='x'/>{{}}</robot>"
    path.write_text(deep.format(""))
    assert wbc.robots.load(path).nv == 1
    path.write_text(deep.format("&"))
    with pytest.raises(RobotFileError, match="more than 500 elements within each other"):
        wbc.robots.load(path)
