"""Robots in xacro and USD: the same as what they were made of, and refused by name where they cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wbc
from tests.refusals import assert_refused
from tests.repeats import repeats
from wbc.errors import RobotFileError, UnknownNameError
from wbc.multibody import pin

XACRO = """<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="count" default="2"/><xacro:property name="count" value="$(arg count)"/>
<link name="link0"/>
<xacro:macro name="segment" params="i">
<link name="link${i}">
<inertial><mass value="${0.5*i}"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="joint${i}" type="revolute"><parent link="link${i-1}"/><child link="link${i}"/><origin xyz="0 0 ${0.1*i}"/>
<axis xyz="0 1 0"/><limit lower="${-pi/2}" upper="${pi/2}" velocity="1" effort="1"/></joint>
<xacro:if value="${i &lt; int(count)}"><xacro:segment i="${i+1}"/></xacro:if></xacro:macro>
<xacro:segment i="1"/></robot>"""


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_xacro_file_is_what_it_expands_to(count: int, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf.xacro").write_text(XACRO)
    robot = wbc.robots.load(tmp_path / "arm.urdf.xacro", arguments={"count": count})
    assert (robot.name, robot.joint_names) == ("arm", tuple(f"joint{k}" for k in range(1, count + 1)))
    assert np.allclose(robot.limits.position_upper, np.pi / 2)
    assert np.allclose(robot.pose(robot.neutral, f"link{count}").translation[2], 0.1 * sum(range(1, count + 1)))
    assert np.isclose(pin.computeTotalMass(robot.model), 0.5 * sum(range(1, count + 1)))
    assert len(robot.shapes) == count


def test_a_xacro_file_includes_files_beside_it_and_of_packages_beside_its_own(tmp_path: Path) -> None:
    """With blocks, a file of numbers, arguments and what is there only unless one is given."""
    here, other = tmp_path / "mine" / "urdf", tmp_path / "other"
    for folder in (here / "parts", other):
        folder.mkdir(parents=True)
    for package in (tmp_path / "mine", other):
        (package / "package.xml").write_text(f"<package><name>{package.name}</name></package>")
    head = '<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    (here / "parts" / "numbers.yaml").write_text("joint1: {upper: !degrees 90}")
    (here / "parts" / "link.xacro").write_text(
        f"""{head}<xacro:property name="limits" value="${{xacro.load_yaml('parts/numbers.yaml')}}"/>
<xacro:macro name="body" params="name mass:=1.0 *origin"><link name="${{name}}"><inertial><xacro:insert_block
name="origin"/><mass value="${{mass}}"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
</xacro:macro></robot>"""
    )
    (other / "tool.xacro").write_text(f'{head}<link name="tool"/></robot>')
    file = here / "arm.xacro"
    file.write_text(
        f"""{head}<xacro:arg name="held" default="true"/><xacro:include filename="parts/link.xacro"/><link name="base"/>
<xacro:body name="arm" mass="${{2**-1}}"><origin xyz="0 0 ${{0.1*3}}"/></xacro:body>
<joint name="joint1" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="0" upper="${{limits['joint1']['upper']}}" velocity="1" effort="1"/></joint>
<xacro:unless value="$(arg held)"><xacro:include filename="$(find other)/tool.xacro"/>
<joint name="fixed" type="fixed"><parent link="arm"/><child link="tool"/></joint></xacro:unless></robot>"""
    )
    robot = wbc.robots.load(file, arguments={"held": "false"})
    assert "tool" in robot.frame_names
    assert np.isclose(robot.limits.position_upper[0], np.pi / 2)
    inertia = robot.model.inertias[1]
    assert np.allclose([inertia.mass, *inertia.lever], [0.5, 0.0, 0.0, 0.3])
    assert "tool" not in wbc.robots.load(file).frame_names
    assert_refused(lambda: wbc.robots.load(file, arguments={"hold": "false"}), UnknownNameError, "held")


def test_a_xacro_file_that_cannot_be_expanded_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.xacro"
    bad.write_text('<robot name="a" xmlns:xacro="x"><link name="${no_such}"/></robot>')
    assert_refused(lambda: wbc.robots.load(bad), RobotFileError, "no_such")
    bad.write_text('<robot name="a" xmlns:xacro="x"><xacro:include filename="$(find nowhere)/x.xacro"/></robot>')
    assert_refused(lambda: wbc.robots.load(bad), RobotFileError, "nowhere")
    assert_refused(lambda: wbc.robots.load(tmp_path / "none.xacro"), RobotFileError, "no such file")
    named_urdf = tmp_path / "bad.urdf"
    named_urdf.write_text(bad.read_text().replace('"x"', '"http://www.ros.org/wiki/xacro"'))
    assert_refused(lambda: wbc.robots.load(named_urdf), RobotFileError, "call it bad.xacro")
    stage = tmp_path / "x.usda"
    stage.write_text("#usda 1.0\n")
    assert_refused(lambda: wbc.robots.load(stage, arguments={"a": 1}), RobotFileError, "only xacro")


@pytest.mark.parametrize("seed", range(repeats(3)))
def test_poses_of_sdf_are_the_same_however_they_are_written(seed: int, tmp_path: Path) -> None:
    rng, file = np.random.default_rng(seed), tmp_path / "x.sdf"
    turn, place = rng.uniform(-1.5, 1.5, 3), rng.normal(size=3)
    due = pin.SE3(pin.rpy.rpyToMatrix(*turn), place)

    def read(how: str, numbers: Any) -> Any:
        text = " ".join(f"{x:.12g}" for x in numbers)
        file.write_text(
            f"""<sdf version="1.9"><model name="m"><link name="a"/><link name="b"><pose {how}>{text}</pose></link>
<joint name="w" type="fixed"><parent>world</parent><child>a</child></joint>
<joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
        )
        robot = wbc.robots.load(file)
        return robot.pose(robot.neutral, "b").homogeneous

    assert np.allclose(read("", [*place, *turn]), due.homogeneous)
    assert np.allclose(read('degrees="true"', [*place, *np.degrees(turn)]), due.homogeneous)
    assert np.allclose(read('rotation_format="quat_xyzw"', pin.SE3ToXYZQUAT(due)), due.homogeneous)
    bad = 'rotation_format="quat_xyzw"', [*place, 1.0, 1.0, 0.0, 0.0]
    assert_refused(lambda: read(*bad), RobotFileError, "pose of b has no unit quaternion")
    assert_refused(lambda: read('rotation_format="angles"', place), RobotFileError, "'angles'")


def stage_of(model: pin.Model, path: Path, unit: float, turned: bool, up: str, down: tuple[float, ...]) -> None:
    """A model of joints with one coordinate as a stage of its own unit and up axis, bodies at a random configuration;
    ``down``: where the gravity of its scene pulls, 0 for where the up axis says.
    """
    from pxr import Gf, Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    UsdPhysics.Scene.Define(stage, "/scene").CreateGravityDirectionAttr(Gf.Vec3f(*down))
    data = model.createData()
    pin.forwardKinematics(model, data, pin.randomConfiguration(model))

    def quaternion(rotation: np.ndarray) -> Any:
        x, y, z, w = pin.Quaternion(rotation).coeffs().tolist()
        return Gf.Quatf(w, x, y, z)

    for j in range(1, model.njoints):
        body = UsdGeom.Xform.Define(stage, f"/robot/link{j}")
        place = data.oMi[j].homogeneous.copy()
        place[:3, 3] /= unit
        body.AddTransformOp().Set(Gf.Matrix4d(*place.T.ravel().tolist()))
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        mass, inertia = UsdPhysics.MassAPI.Apply(body.GetPrim()), model.inertias[j]
        moments, axes = np.linalg.eigh(inertia.inertia)
        axes[:, 2] *= np.linalg.det(axes)
        mass.CreateMassAttr(inertia.mass)
        mass.CreateCenterOfMassAttr(Gf.Vec3f(*(inertia.lever / unit).tolist()))
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*(moments / unit**2).tolist()))
        mass.CreatePrincipalAxesAttr(quaternion(axes))
        turns = model.joints[j].shortname().startswith("JointModelR")
        joint = (UsdPhysics.RevoluteJoint if turns else UsdPhysics.PrismaticJoint).Define(
            stage, f"/robot/{model.names[j]}"
        )
        joint.CreateAxisAttr(model.joints[j].shortname()[-1])
        parent, here = int(model.parents[j]), model.jointPlacements[j]
        ends = [[f"/robot/link{parent}"] if parent else [], [f"/robot/link{j}"]]
        poses = [(Gf.Vec3f(*(here.translation / unit).tolist()), quaternion(here.rotation)), (Gf.Vec3f(0), Gf.Quatf(1))]
        if turned and not parent:
            # The world as the second body
            ends.reverse()
            poses.reverse()
        joint.CreateBody0Rel().SetTargets(ends[0])
        joint.CreateBody1Rel().SetTargets(ends[1])
        joint.CreateLocalPos0Attr(poses[0][0])
        joint.CreateLocalRot0Attr(poses[0][1])
        joint.CreateLocalPos1Attr(poses[1][0])
        joint.CreateLocalRot1Attr(poses[1][1])
        scale, q = (180.0 / np.pi if turns else 1.0 / unit), int(model.idx_qs[j])
        joint.CreateLowerLimitAttr(float(model.lowerPositionLimit[q] * scale))
        joint.CreateUpperLimitAttr(float(model.upperPositionLimit[q] * scale))
    stage.Save()


@pytest.mark.parametrize("seed", range(repeats(4)))
def test_a_stage_is_the_robot_that_it_was_made_of(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    given = wbc.robots.load(["panda", "ur5", "z1", "xarm7"][seed % 4])
    up, down, turn = (
        ("Z", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ("Y", (0.0, 0.0, 0.0), (np.pi / 2.0, 0.0, 0.0)),
        ("Y", (0.0, 0.0, -2.0), (0.0, 0.0, 0.0)),
        ("Z", (1.0, 0.0, 0.0), (0.0, np.pi / 2.0, 0.0)),
    )[seed % 4]
    upright = pin.SE3(pin.rpy.rpyToMatrix(*turn), np.zeros(3))
    stage_of(given.model, tmp_path / "x.usda", float(rng.choice([0.01, 1.0])), bool(seed % 2), up, down)
    robot = wbc.robots.load(tmp_path / "x.usda")
    assert robot.joint_names == given.joint_names
    assert np.allclose(robot.limits.position_lower, given.limits.position_lower, atol=1e-5)
    q, data = given.random(rng), given.model.createData()
    pin.forwardKinematics(given.model, data, q)
    for j in range(1, given.model.njoints):
        assert np.allclose(robot.pose(q, f"link{j}").homogeneous, (upright * data.oMi[j]).homogeneous, atol=1e-6)
    mass = pin.crba(given.model, data, q)
    assert np.allclose(pin.crba(robot.model, robot.model.createData(), q), mass, atol=1e-5 * np.abs(mass).max())


def test_bodies_of_instances_are_bodies(tmp_path: Path) -> None:
    import pxr  # noqa: F401

    api = '(prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])'
    body = "{{\nfloat physics:mass = {}\nfloat3 physics:diagonalInertia = (1, 1, 1)\n}}\n"
    (tmp_path / "x.usda").write_text(
        f"""#usda 1.0
(metersPerUnit = 1)
class Xform "arm" {{
def Xform "hand" {api} {body.format(2)}}}
def Xform "left" (
instanceable = true
prepend references = </arm>
) {{
}}
def Xform "base" {api} {body.format(3)}
def PhysicsRevoluteJoint "wrist" {{
rel physics:body0 = </base>
rel physics:body1 = </left/hand>
}}"""
    )
    robot = wbc.robots.load(tmp_path / "x.usda")
    assert (robot.base, robot.joint_names) == ("floating", ("root_joint", "wrist"))
    assert pin.computeTotalMass(robot.model) == 5.0


def test_what_a_stage_cannot_say_is_refused_by_name(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    import pxr  # noqa: F401

    head = "#usda 1.0\n(metersPerUnit = 1)\n"
    head += 'def Xform "a" (prepend apiSchemas = ["PhysicsRigidBodyAPI"{more}]) {{ {mass} }}\n'
    file = tmp_path / "x.usda"
    file.write_text("#usda 1.0\n")
    assert_refused(lambda: wbc.robots.load(file), RobotFileError, "no rigid bodies")
    file.write_text("junk")
    assert_refused(lambda: wbc.robots.load(file), RobotFileError, "cannot be opened")
    file.write_text(head.format(more="", mass=""))
    assert_refused(lambda: wbc.robots.load(file), RobotFileError, "'a' states no mass")
    given = "float physics:mass = 1\nfloat3 physics:diagonalInertia = (1, 1, 1)\n"
    distance = '\ndef PhysicsDistanceJoint "far" {\nrel physics:body1 = </a>\n}\n'
    file.write_text(head.format(more=', "PhysicsMassAPI"', mass=given) + distance)
    assert_refused(lambda: wbc.robots.load(file), RobotFileError, "PhysicsDistanceJoint")
    moon = 'def PhysicsScene "scene" {\nfloat physics:gravityMagnitude = 1.62\n}\n'
    more = ', "PhysicsMassAPI", "PhysxRigidBodyAPI", "NewtonMimicAPI"'
    file.write_text(head.format(more=more, mass=given) + moon + 'def MjcActuator "motor" {\n}\n')
    robot = wbc.robots.load(file)
    assert robot.base == "floating"
    assert robot.model.gravity.linear == pytest.approx([0.0, 0.0, -1.62])
    assert "not represented: PhysxRigidBodyAPI, NewtonMimicAPI of a; MjcActuator of motor\n" in caplog.text
