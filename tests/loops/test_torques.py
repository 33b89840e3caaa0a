"""Loops in stacks of accelerations and torques: MuJoCo and Pinocchio say what motors give, and plants follow."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import casadi as ca
import mujoco
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import MOTORS, NAMED, body, hinge, mjcf, random_linkage, with_motors, within
from tests.loops.test_loops import opened
from tests.repeats import repeats
from wbc.errors import RangeError, UnknownNameError, UnsupportedJointError
from wbc.robot import JointCurve, Loop, LoopError, Robot
from wbc.robots import MujocoJoints
from wbc.servo import Servo
from wbc.simulation import Command, CommandKind, MujocoPlant, PinocchioPlant, Plant, VelocityDrive, mujoco_model
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

DT = 0.002
#: Of so many ticks one is looked at
SPARSE = 8


@cache
def driven(name: str) -> Robot:
    """A named mechanism as its file says that motors drive it."""
    return wbc.robots.load(with_motors(NAMED[name], MOTORS[name]), velocity=3.0, acceleration=200.0)


@cache
def linkage(seed: int) -> tuple[str, Robot]:
    """A random one with as many motors as motions, and not near a dead point."""
    tree, rng = wbc.robots.load(random_linkage(seed)), np.random.default_rng(seed)
    many = tree.motor_jacobian(tree.neutral)
    count = int(np.linalg.matrix_rank(many, 1e-7))
    for _ in range(500):
        motors = [str(name) for name in rng.choice(tree.joint_names, count, replace=False)]
        robot = tree.with_actuated(motors)
        jacobian = robot.motor_jacobian(tree.neutral)
        if np.linalg.matrix_rank(jacobian, 1e-7) == count and np.abs(jacobian).max() < 10.0:
            text = with_motors(random_linkage(seed), motors)
            return text, wbc.robots.load(text, velocity=3.0, acceleration=200.0)
    raise AssertionError(f"linkage {seed} has no motors far from dead points")


def stack_of(robot: Robot) -> wbc.Stack:
    """A posture of all joints within their limits."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture")
    return stack.add(wbc.tasks.JointLimits())


@cache
def rows_of(robot: Robot) -> ca.Function:
    """q -> Jacobian of the loops."""
    kin = Tracer(Kinematics(robot.model))
    return ca.Function("rows", [kin.q], [ca.densify(kin.jacobian(robot.loops.error(kin)))])


def rows_at(robot: Robot, q: Array) -> Array:
    """Jacobian of the loops."""
    return np.array(rows_of(robot)(q))


def moving(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A closed configuration near neutral, and a velocity that keeps it closed."""
    q, v = robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv)), rng.normal(size=robot.nv)
    rows = rows_at(robot, q)
    return q, v - np.linalg.pinv(rows, 1e-7) @ rows @ v


@cache
def simulated(robot: Robot, text: str) -> tuple[mujoco.MjModel, mujoco.MjData, MujocoJoints]:
    """A file as MuJoCo has it; no text: the model that is made here."""
    model = mujoco.MjModel.from_xml_string(text) if text else mujoco_model(robot)
    return model, mujoco.MjData(model), MujocoJoints(model, robot)


def needed(robot: Robot, text: str, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """(torques of the motors, how far these and forces in loops are from moving the robot so) for accelerations, by
    MuJoCo's mass matrix, bias forces and Jacobian of the equalities: M a + h = S' tau + J' f.
    """
    model, data, joints = simulated(robot, text)
    joints.put_q(data.qpos, q)
    joints.put_v(data.qvel, q, v)
    mujoco.mj_forward(model, data)
    mass, spread, change = np.zeros((model.nv, model.nv)), np.zeros((robot.nv, model.nv)), np.zeros(model.nv)
    mujoco.mj_fullM(model, data, mass)
    for row, unit in zip(spread, np.eye(robot.nv), strict=True):
        joints.put_v(row, q, unit)
    joints.put_v(change, q, a)
    equal = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    rows = data.efc_J.reshape(data.nefc, model.nv)[equal]
    forces, motors = mass @ change + data.qfrc_bias, spread[list(robot.motors)]
    found = np.linalg.lstsq(np.concatenate([motors, rows]).T, forces, rcond=1e-10)[0]
    return found[: len(motors)], forces - np.concatenate([motors, rows]).T @ found


def compare(robot: Robot, text: str, seed: int, states: int) -> None:
    """Torques and accelerations of ticks at random states against both."""
    controller, rng = stack_of(robot).compile(command="torque"), np.random.default_rng(seed)
    loops = [loop for loop in robot.loops.loops if isinstance(loop, Loop)]
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for loop in loops:
        ends = [robot.model.frames[robot.model.getFrameId(name)] for name in (loop.first, loop.second)]
        kind = pin.ContactType.CONTACT_3D if loop.kind == "connect" else pin.ContactType.CONTACT_6D
        places = [part for end in ends for part in (int(end.parentJoint), end.placement)]
        models.append(pin.RigidConstraintModel(kind, robot.model, *places, pin.ReferenceFrame.LOCAL))
        datas.append(models[-1].createData())
    data = robot.model.createData()
    pin.initConstraintDynamics(robot.model, data, models, datas)
    for _ in range(states):
        q, v = moving(robot, rng)
        controller.reset(q)
        controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
        step = controller.step(q, v)
        assert step.status == "solved", step
        motors = list(robot.motors)
        torques, missing = needed(robot, text, q, v, step.a)
        size = max(1.0, float(np.abs(torques).max()))
        assert np.abs(missing).max() < 1e-6 * size
        assert np.abs(step.torque[motors] - torques).max() < 1e-6 * size
        assert not np.delete(step.torque, motors).any()
        if len(loops) == len(robot.loops.loops):
            settings = pin.ProximalSettings(1e-13, 1e-10, 50)
            a = pin.constraintDynamics(robot.model, data, q, v, np.array(step.torque), models, datas, settings)
            assert np.abs(a - step.a).max() < 1e-6 * max(1.0, float(np.abs(a).max()))
            # Pinocchio gives what acts on the first body; forces of a loop that is there twice may be others
            known = np.linalg.matrix_rank(rows_at(robot, q), 1e-7) == len(robot.loops.rows)
            for loop, found in zip(loops if known else [], datas, strict=False):
                own = step.loop_forces[loop.name]
                force = np.array(found.contact_force.vector)[: len(own)]
                gap = np.abs(own + force).max()
                assert gap < 1e-5 * max(1.0, float(np.abs(force).max()))


@pytest.mark.parametrize("name", NAMED)
def test_torques_are_those_that_mujoco_and_pinocchio_say(name: str) -> None:
    compare(driven(name), with_motors(NAMED[name], MOTORS[name]), 0, repeats(6))


@pytest.mark.parametrize("seed", range(repeats(8)))
def test_torques_of_random_linkages(seed: int) -> None:
    text, robot = linkage(seed)
    compare(robot, text, seed, 4)


def test_a_floating_robot_with_loops_stands_on_a_contact() -> None:
    """The base, passive joints and loops at once: what is left of M a + h - tau is what the contact gives."""
    robot = wbc.robots.load(with_motors(NAMED["ankle"], MOTORS["ankle"]), base="floating", acceleration=200.0)
    stack = stack_of(robot).add(wbc.tasks.RigidGrasp("foot"), name="foot")
    q = robot.neutral
    step = stack.compile(command="torque").step(q, np.zeros(robot.nv))
    assert step.status == "solved"
    data = robot.model.createData()
    left = pin.rnea(robot.model, data, q, np.zeros(robot.nv), np.array(step.a)) - step.torque
    index = robot.model.getFrameId("foot", pin.FrameType.BODY)
    left -= pin.computeFrameJacobian(robot.model, data, q, index, pin.LOCAL).T @ step.forces["foot"]
    motion = robot.motor_jacobian(q)
    assert np.abs(motion.T @ left).max() < 1e-6 * np.abs(step.forces["foot"]).max()
    assert not step.torque[list(robot.unactuated)].any()


def test_redundant_motors_share_and_limits_of_motors_hold() -> None:
    """All joints of a four-bar driven, one weakly: the others give what it cannot."""
    robot = wbc.robots.load(with_motors(NAMED["four_bar"], ("motor", "knee", "heel")), acceleration=200.0, velocity=3.0)
    weak = robot.with_limits(effort={"motor": 0.1})
    for one in (robot, weak):
        controller = stack_of(one).add(wbc.tasks.TorqueLimits()).compile(command="torque")
        q, v = moving(one, np.random.default_rng(0))
        controller.reset(q)
        step = controller.step(q, v)
        assert step.status == "solved"
        text = with_motors(NAMED["four_bar"], ("motor", "knee", "heel"))
        assert np.abs(needed(one, text, q, v, step.a)[1]).max() < 1e-6
        assert np.abs(step.torque[0]) <= one.limits.effort[0] + 1e-9
    assert np.abs(step.torque[1:]).max() > 0.1


def test_limits_of_motors_hold_the_linkage() -> None:
    """A motor that is too weak to lift the linkage gives all it has, and the motion is the one that this allows."""
    robot = driven("four_bar").with_limits(effort={"motor": 0.5})
    controller = stack_of(robot).add(wbc.tasks.TorqueLimits()).compile(command="torque")
    q = robot.neutral
    controller["posture"].target = robot.integrate(q, robot.motor_jacobian(q) @ [-1.0])
    step = controller.step(q, np.zeros(robot.nv))
    assert step.status == "solved"
    assert abs(step.torque[0]) == pytest.approx(0.5)
    text = with_motors(NAMED["four_bar"], MOTORS["four_bar"])
    assert needed(robot, text, q, np.zeros(3), step.a)[0] == pytest.approx(step.torque[:1], abs=1e-7)


def test_accelerations_keep_loops_closed() -> None:
    """To 1e-9 where the step leads; an open loop closes, no faster than it may."""
    robot, text = driven("delta"), NAMED["delta"]
    controller, rng = stack_of(robot).compile(command="acceleration"), np.random.default_rng(0)

    def run(q: Array, ticks: int, every: int) -> Array:
        v, on_way = np.zeros(robot.nv), []
        controller.reset(q)
        for k in range(ticks):
            if k % every == 0:
                controller["posture"].target = pin.integrate(robot.model, q, rng.normal(size=robot.nv))
            step = controller.step(q, v)
            assert step.status == "solved"
            q, v = np.array(step.q_next), np.array(step.v)
            on_way.append(q)
        assert np.abs(v).max() > 0.1, "nothing moved"
        return np.array([opened(robot, text, [q]) for q in on_way[::SPARSE]])

    assert run(robot.neutral, 200, 50).max() < 1e-9
    gaps = run(pin.integrate(robot.model, robot.neutral, 0.005 * np.eye(robot.nv)[0]), 400, 400)
    assert gaps[0] > 4e-3
    assert gaps[-1] < 1e-9
    assert -np.diff(gaps).min() < 0.11 * robot.characteristic_length * SPARSE * DT


def coarse(robot: wbc.Robot, count: int, command: str = "acceleration", dt: float = 0.02) -> Iterator[wbc.Step]:
    """Ticks of 20 ms, in which loops bend by more than rounding of limits."""
    rng = np.random.default_rng(0)
    stack = wbc.Stack(robot, dt).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    controller, q, v = stack.compile(command=command), robot.neutral, np.zeros(robot.nv)
    controller.reset(q)
    for k in range(count):
        if k % 30 == 0:
            controller["posture"].target = pin.integrate(robot.model, q, 2.0 * rng.normal(size=robot.nv))
        step = controller.step(q, v)
        yield step
        q, v = np.array(step.q_next), np.array(step.v)


def test_velocities_that_keep_loops_closed_are_within_limits() -> None:
    robot = driven("delta")
    for step in coarse(robot, 450):
        assert step.status == "solved"
        assert np.abs(step.v).max() <= 3.0 * (1.0 + 1e-9)
        assert np.abs(step.a).max() <= 200.0 * (1.0 + 1e-9)
        assert max(robot.loop_gaps(step.q_next).values()) <= 1e-9


def test_positions_to_which_torques_lead_are_within_limits() -> None:
    """Limits of motion are rows there that may give way; closing loops must not pass them in silence."""
    robot = within(driven("delta"), 0.3)
    index, has = robot.position_index, robot.position_index >= 0
    lower, upper = robot.limits.position_lower[has], robot.limits.position_upper[has]
    nearest = np.inf
    for step in coarse(robot, 450, "torque", 0.01):
        assert step.status == "solved"
        room = np.minimum(step.q_next[index[has]] - lower, upper - step.q_next[index[has]])
        assert room.min() >= -1e-10
        nearest = min(nearest, room.min())
    assert nearest < 1e-4, "no limit is met"


def test_coarse_ticks_of_an_ankle_are_solved() -> None:
    """One of these gave way: where it led no correction of its size closed the loops."""
    robot = driven("ankle")
    for step in coarse(robot, 450):
        assert step.status == "solved"
        assert max(robot.loop_gaps(step.q_next).values()) <= 1e-9


def falling_rod() -> str:
    """A crank, a rod on a ball joint and a rocker, of millimetres: the rod turns under its weight as no motor can."""
    y, x = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    rod = body("rod", np.array([0.0, 0.0, 0.003]), '<joint name="ball" type="ball"/>')
    bodies = body("crank", np.zeros(3), hinge("in", y), rod)
    bodies += body("rocker", np.array([0.006, 0.002, 0.0]), hinge("out", x))
    text = mjcf("falling", bodies, '<connect name="pin" body1="rod" body2="rocker" anchor="0.005 0.001 0.001"/>')
    text = text.replace('pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"', FALLING)
    return with_motors(text.replace('gravity="0 0 0"', 'gravity="0 0 -9.81"'), ["in"])


#: The inertia of its links
FALLING = 'pos="2e-4 1e-4 3e-4" mass="1" diaginertia="1e-6 1e-6 1e-6"'


def test_loops_stay_closed_where_limits_of_motion_give_way() -> None:
    """They opened by a fiftieth of the mechanism when the rod turned faster than it may."""
    robot = wbc.robots.load(falling_rod(), shapes="none", velocity=3.0, acceleration=200.0)
    stack = wbc.Stack(robot, 0.005).add(wbc.tasks.Posture()).add(wbc.tasks.JointLimits())
    controller, q, v, fastest, relaxed = stack.compile(command="torque"), robot.neutral, np.zeros(robot.nv), 0.0, 0
    for _ in range(80):
        step = controller.step(q, v)
        q, v = np.array(step.q_next), np.array(step.v)
        relaxed += step.status == "relaxed"
        fastest = max(fastest, float(np.abs(v).max()))
        assert max(robot.loop_gaps(q).values()) <= 1e-9
        assert np.abs(rows_at(robot, q) @ v).max() <= 1e-9
    assert relaxed > 40
    assert fastest > 10.0


def plants(robot: Robot, text: str) -> dict[str, Plant]:
    """Pinocchio with constraints, MuJoCo with the model made here, and MuJoCo with the file as it is."""
    own = mujoco.MjModel.from_xml_string(text.replace("</mujoco>", '<option timestep="0.001"/></mujoco>'))
    return {
        "pinocchio": PinocchioPlant(robot),
        "mujoco": MujocoPlant(mujoco_model(robot), robot),
        "file": MujocoPlant(own, robot),
    }


@pytest.mark.parametrize("name", ["four_bar", "ankle", "gripper"])
@pytest.mark.parametrize("command", ["velocity", "torque"])
def test_plants_follow(name: str, command: str) -> None:
    """A step of 0.2 rad of the motors: it arrives as the gain says, and the plant's loops stay closed."""
    robot, text = driven(name), with_motors(NAMED[name], MOTORS[name])
    target = robot.integrate(robot.neutral, robot.motor_jacobian(robot.neutral) @ np.full(len(robot.motors), 0.2))
    for kind, plant in plants(robot, text).items():
        stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(gain=10.0), name="posture").add(wbc.tasks.JointLimits())
        controller = stack.compile(command=command)
        drive = VelocityDrive(robot, plant) if command == "velocity" else plant
        drive.reset(robot.neutral, 0.0)
        controller["posture"].target = target
        for _ in range(150):
            state = drive.read()
            step = controller.step(state.q, state.v) if command == "torque" else controller.step(state.q)
            assert step.status == "solved", (kind, step)
            drive.apply(Command(CommandKind(command), step.torque if command == "torque" else step.v))
            drive.advance(DT)
        q = drive.read().q
        # MuJoCo's constraints are springs: those of a file that says nothing are softer than those made here
        most = {"pinocchio": 1e-9, "mujoco": 1e-5, "file": 1e-2}[kind]
        assert np.abs(robot.difference(robot.closed(q), q)).max() < most, kind
        moved = list(robot.motors)
        assert np.abs(robot.difference(q, target)[moved]).max() < 0.02, kind


def test_a_servo_of_torques_moves_a_linkage() -> None:
    robot = driven("four_bar")
    controller = stack_of(robot).compile()
    controller["posture"].target = target = robot.integrate(
        robot.neutral, robot.motor_jacobian(robot.neutral) @ np.full(1, 0.2)
    )
    servo, plant = Servo(controller, "torque", learn=False), PinocchioPlant(robot, 0.002, integrator="midpoint")
    plant.reset(robot.neutral, 0.0)
    servo.reset(robot.neutral)
    for _ in range(300):
        state = plant.read()
        plant.apply(servo.step(state.q, state.v).command)
        plant.advance(DT)
    assert np.abs(robot.difference(plant.read().q, target)).max() < 0.1
    assert np.abs(robot.difference(plant.read().q, servo.reference)).max() < 1e-3


def test_recordings_batches_pickles_and_exports_of_torques(tmp_path: Path) -> None:
    robot = driven("ankle").with_limits(effort={"left_motor": 2.0, "right_motor": 2.0})
    controller = stack_of(robot).add(wbc.tasks.TorqueLimits()).compile(command="torque")
    q, v = moving(robot, np.random.default_rng(3))
    controller.reset(q)
    with controller.record(tmp_path / "run.npz"):
        steps = [controller.step(q, v) for _ in range(3)]
    assert wbc.replay(tmp_path / "run.npz").identical
    batch = controller.batch(2).step(np.array([q, q]), np.array([v, v]))
    assert np.array_equal(batch.torque[1], steps[0].torque)
    again = pickle.loads(pickle.dumps(steps[0]))
    for name, force in steps[0].loop_forces.items():
        assert np.array_equal(again.loop_forces[name], force)
        assert np.array_equal(batch.loop_forces[name][1], force)
    assert (controller.export(tmp_path / "tick", states=20) / "Makefile").exists()


def test_derivatives_count_loops() -> None:
    robot, h = driven("ankle"), 1e-6
    controller = stack_of(robot).compile(command="torque")
    q, v = moving(robot, np.random.default_rng(3))
    controller.reset(q)
    step = controller.step(q, v)

    def a(dq: Array, dv: Array) -> Array:
        controller.reset(q)
        return np.array(controller.step(pin.integrate(robot.model, q, dq), v + dv).a)

    nothing = np.zeros(robot.nv)
    for k in range(0, robot.nv, 3):
        unit = h * np.eye(robot.nv)[k]
        by_q = (a(unit, nothing) - a(-unit, nothing)) / (2.0 * h)
        by_v = (a(nothing, unit) - a(nothing, -unit)) / (2.0 * h)
        assert np.abs(step.derivative("q")[:, k] - by_q).max() < 1e-4 * np.abs(by_q).max()
        assert np.abs(step.derivative("v")[:, k] - by_v).max() < 1e-4 * np.abs(by_v).max()


@pytest.mark.parametrize("name", ["four_bar", "delta", "gripper"])
def test_the_jacobian_of_motors_is_the_rate_of_a_closed_motion(name: str) -> None:
    robot, h = driven(name), 1e-6
    q, _ = moving(robot, np.random.default_rng(1))
    G, motors = robot.motor_jacobian(q), list(robot.motors)
    assert np.allclose(G[motors], np.eye(len(motors)), atol=1e-9)
    for column in G.T:
        ends = [robot.closed(pin.integrate(robot.model, q, sign * h * column)) for sign in (1.0, -1.0)]
        assert np.abs(robot.difference(ends[1], ends[0]) / (2.0 * h) - column).max() < 1e-6 * np.abs(column).max()


def test_a_dead_point_has_no_jacobian() -> None:
    """The motor at the heel of a slider-like four-bar whose crank and coupler are in line says nothing of the crank."""
    robot = wbc.robots.load(NAMED["four_bar"]).with_actuated(["heel"])
    crank, coupler, closing = 0.2, float(np.hypot(0.45, 0.1)), robot.motor_jacobian
    assert closing(robot.neutral).shape == (3, 1)
    bend = np.arctan2(0.45, 0.1)
    tree = robot.with_loops()
    # Coupler folded out along the crank: the pin is crank + coupler away from the motor
    q = np.array([1.0, -bend, 0.0])
    pin_end = tree.pose(q, "coupler").act(np.array([0.45, 0.0, 0.1]))
    assert np.linalg.norm(pin_end) == pytest.approx(crank + coupler)
    dead = tree.with_frame("pin end", "coupler", pin.SE3(np.eye(3), np.array([0.45, 0.0, 0.1])))
    dead = dead.with_frame("peg", "rocker", tree.pose(q, "rocker").actInv(pin.SE3(np.eye(3), pin_end)))
    dead = dead.with_loops(Loop("pin again", "pin end", "peg"), actuated=["heel"])
    with pytest.raises(LoopError, match=r"dead point.*(motor|knee)"):
        dead.motor_jacobian(q)


def test_a_passive_joint_of_a_tree_has_no_torque() -> None:
    """A pole on a cart: what the cart's motor gives moves both."""
    text = (
        '<mujoco><worldbody><body name="cart"><joint name="slide" type="slide" axis="1 0 0"/><geom size=".1"/>'
        '<body name="pole"><joint name="swing" axis="0 1 0"/><geom pos="0 0 1" size=".1"/></body></body></worldbody>'
        '<actuator><motor joint="slide"/></actuator></mujoco>'
    )
    robot = wbc.robots.load(text)
    assert (robot.motor_names, robot.passive) == (("slide",), (1,))
    q, v = np.array([0.0, 0.3]), np.array([0.0, 0.5])
    step = stack_of(robot).compile(command="torque").step(q, v)
    tau = pin.rnea(robot.model, robot.model.createData(), q, v, np.array(step.a))
    assert tau == pytest.approx(step.torque, abs=1e-7)
    assert (step.torque[1], abs(step.torque[0]) > 1.0) == (0.0, True)


def test_motors_are_declared(tmp_path: Path) -> None:
    robot = driven("gripper")
    assert robot.motor_names == ("left_motor",)
    tree = wbc.robots.load(NAMED["four_bar"], actuated=["motor"])
    assert tree.motor_names == ("motor",)
    assert pickle.loads(pickle.dumps(tree)).passive == tree.passive
    assert tree.fingerprint != wbc.robots.load(NAMED["four_bar"]).fingerprint
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
    link = f'<link name="{{}}"><inertial><mass value="1"/>{inertia}</inertial></link>'
    joint = '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><axis xyz="0 1 0"/></joint>'
    urdf = tmp_path / "arm.urdf"
    parts = [link.format(name) for name in "abc"] + [joint.format("j1", "a", "b"), joint.format("j2", "b", "c")]
    driven_by = '<transmission name="t"><joint name="j2"/></transmission>'
    urdf.write_text(f'<robot name="arm">{"".join(parts)}{driven_by}</robot>')
    assert wbc.robots.load(urdf).motor_names == ("j1", "j2")
    assert wbc.robots.load(urdf, actuated="transmissions").motor_names == ("j2",)
    urdf.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    with pytest.raises(RangeError, match="no transmission"):
        wbc.robots.load(urdf, actuated="transmissions")
    with pytest.raises(UnknownNameError, match="motor"):
        wbc.robots.load(NAMED["four_bar"], actuated=["moter"])
    with pytest.raises(RangeError, match="no motor drives this joint"):
        wbc.Stack(robot, DT).add(wbc.tasks.TorqueLimits(("left_knuckle",)))
    with pytest.raises(RangeError, match="floating base"):
        wbc.robots.load("talos", shapes="none").with_actuated(["root_joint"])


def test_plants_move_motors_alone_and_refuse_what_is_open() -> None:
    robot = driven("four_bar")
    plant, data = PinocchioPlant(robot), robot.model.createData()
    weight = pin.computeGeneralizedGravity(robot.model, data, robot.neutral)
    plant.apply(Command(CommandKind.TORQUE, robot.at_motors(robot.neutral, weight) + [0.0, 5.0, 5.0]))
    plant.advance(0.01)
    assert np.abs(plant.state.v).max() < 1e-6
    plant.apply(Command(CommandKind.TORQUE, np.array([5.0, 0.0, 0.0])))
    plant.advance(0.01)
    assert np.abs(plant.state.v).max() > 0.01
    with pytest.raises(RangeError, match=r"pin\.[xz] open"):
        plant.reset(robot.neutral + [0.0, 0.1, 0.0], 0.0)
    with pytest.raises(RangeError, match=r"pin\.[xz] open"):
        plant.reset(robot.neutral, 0.0, [0.0, 0.1, 0.0])
    steep = robot.with_loops(*robot.loops.loops, JointCurve("steep", "knee", "motor", (0, 0, 0, 0, 0, 1.0)))
    with pytest.raises(UnsupportedJointError, match="power 4"):
        mujoco_model(steep)


def test_mujoco_models_are_of_robots_whose_links_are_off_their_joints() -> None:
    text = (
        '<mujoco><worldbody><body name="arm"><joint name="arm" pos="0 0 .2" axis="0 1 0"/><geom size=".1"/>'
        '<body name="hand" pos=".5 0 0"><joint name="wrist" pos="-.1 0 0" axis="0 0 1" ref=".3"/><geom size=".1"/>'
        '</body></body></worldbody><actuator><motor joint="arm"/><motor joint="wrist"/></actuator></mujoco>'
    )
    robot = wbc.robots.load(text)
    plant = MujocoPlant(mujoco_model(robot), robot)
    plant.apply(Command(CommandKind.TORQUE, np.array([1.0, 2.0])))
    plant.advance(0.001)
    data = robot.model.createData()
    a = pin.aba(robot.model, data, robot.neutral, np.zeros(2), np.array([1.0, 2.0]))
    assert plant.read().v == pytest.approx(0.001 * a, rel=1e-4)
