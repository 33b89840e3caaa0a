"""Ticks of mechanisms with closed loops, beside those of their trees, mink's constraint and Pinocchio's Jacobians."""

from __future__ import annotations

import importlib.util
from time import perf_counter

import mujoco
import numpy as np
import pinocchio as pin

import wbc
from bench.sheet import Sheet, us
from tests.loops.mechanisms import MOTORS, NAMED, with_motors
from wbc.controller import core_of
from wbc.robot import Loop, Robot
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Frame that is moved of each mechanism, ticks, how often they are walked, and time of a tick [s]
MOVED = {"four_bar": "coupler", "ankle": "foot", "gripper": "left_finger", "delta": "plate", "jansen": "leg"}
TICKS, ROUNDS, DT = 600, 3, 0.005
#: How often a robot and its tree are measured one after the other: the least counts, as machines slow down for a while
TURNS = 6
#: Ticks towards one target; gain of postures [1/s] and the fastest that joints move [rad/s, m/s]
EACH, GAIN, SPEED = 60, 5.0, 3.0
#: States of ticks of torques, and the limit of accelerations of their robots [rad/s^2, m/s^2]
STATES, ACCELERATION = 60, 200.0


def parts() -> dict[str, Sheet | str]:
    """A row a mechanism."""
    rows = []
    for name in MOVED:
        robot = wbc.robots.load(NAMED[name], shapes="none").with_limits(velocity=SPEED)
        targets = [robot.random(seed) for seed in range(TICKS // EACH)]
        both = robot, robot.with_loops()
        turns = np.array([[_ours(each, MOVED[name], targets) for each in both] for _ in range(TURNS)])
        (own, call, gap), (tree, tree_call, _) = turns.min(axis=0)
        found = [own, gap, *_mink(robot, name, targets), *_pinocchio(robot, targets)]
        shown = [us(value) if k % 2 == 0 else f"{value:.0e}" for k, value in enumerate(found)]
        size = f"{robot.nv}, {len(robot.loops.rows)}"
        beside = us(tree_call), us(call), f"{own / tree:.2f}, {call / tree_call:.2f}"
        rows.append((name, size, us(tree), *(text.replace("nan", "not installed") for text in shown), *beside))
    head = ("mechanism", "dofs, loop rows", "tick of its tree [us]", "tick [us]", "open [m]", "mink [us]", "open [m]")
    calls = ("`step(q)` of its tree [us]", "`step(q)` [us]", "ratios: tick, call")
    ticks = Sheet("", (*head, "Pinocchio and numpy [us]", "open [m]", *calls), rows)
    return {"ticks": ticks, "torques": Sheet("", TORQUES, [_torques(name) for name in MOVED])}


#: Columns of ticks of torques
TORQUES = (
    "mechanism",
    "tick of its tree [us]",
    "tick [us]",
    "accelerations off Pinocchio's",
    "Pinocchio [us]",
    "accelerations off MuJoCo's, whose loops are springs",
    "MuJoCo [us]",
)


def _torques(name: str) -> tuple[str, ...]:
    """Native ticks that command motors, and how far off Pinocchio's and MuJoCo's accelerations for their torques are,
    relative to the largest.
    """
    text = with_motors(NAMED[name], MOTORS[name])
    robot = wbc.robots.load(text, shapes="none", velocity=SPEED, acceleration=ACCELERATION)
    states = [_state(robot, np.random.default_rng(seed)) for seed in range(STATES)]
    both = robot, robot.with_loops().with_actuated(robot.joint_names)
    turns = [[_torque_ticks(each, states) for each in both] for _ in range(TURNS)]
    own, tree = np.array([[time for time, _ in turn] for turn in turns]).min(axis=0)
    answers = turns[0][0][1]
    pinocchio, mujoco_says = _by_pinocchio(robot, states, answers), _by_mujoco(robot, text, states, answers)
    return (
        name,
        us(tree),
        us(own),
        *(f"{x:.0e}" if k == 0 else us(x) for pair in (pinocchio, mujoco_says) for k, x in enumerate(pair)),
    )


def _state(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """A closed configuration near neutral, and a velocity that keeps it closed."""
    q, v = robot.integrate(robot.neutral, 0.3 * rng.normal(size=robot.nv)), 0.5 * rng.normal(size=robot.nv)
    rows = robot._tied(q)
    return q, v - np.linalg.pinv(rows, 1e-7) @ rows @ v


def _torque_ticks(robot: Robot, states: list[tuple[Array, Array]]) -> tuple[float, list[wbc.Step]]:
    """(median time of a native tick of torques [us], the steps)."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.Posture(), name="posture")
    stack.add(wbc.tasks.JointLimits(acceleration=False))
    controller = stack.compile(command="torque", backend="native")
    tick = core_of(controller).tick
    assert isinstance(tick, NativeTick)
    spent, steps = np.full((ROUNDS, len(states)), np.inf), []
    for turn in range(ROUNDS):
        for k, (q, v) in enumerate(states):
            controller.reset(q)
            steps.append(controller.step(q, v))
            controller.reset(q)
            tick.q[:], tick.v_in[: robot.nv], tick.use_v[:] = q, v, 1.0
            began = perf_counter()
            tick.step_function(tick.pointer)
            spent[turn, k] = perf_counter() - began
    return 1e6 * float(np.median(spent.min(axis=0))), steps[: len(states)]


def _off(found: list[Array], steps: list[wbc.Step]) -> float:
    return max(
        float(np.abs(a - step.a).max() / max(1.0, np.abs(step.a).max())) for a, step in zip(found, steps, strict=True)
    )


def _by_pinocchio(robot: Robot, states: list[tuple[Array, Array]], steps: list[wbc.Step]) -> tuple[float, float]:
    """(relative error of accelerations, median time [us]) of ``pin.constraintDynamics`` under the ticks' torques; NaN
    where it has no constraint of a loop's kind.
    """
    model, data, loops = robot.model, robot.model.createData(), robot.loops.loops
    if any(getattr(loop, "kind", "") != "connect" for loop in loops):
        return np.nan, np.nan
    models, datas, spent, found = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData(), [], []
    for loop in loops:
        assert isinstance(loop, Loop)
        ends = [model.frames[model.getFrameId(end)] for end in (loop.first, loop.second)]
        places = [part for end in ends for part in (int(end.parentJoint), end.placement)]
        models.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *places, pin.ReferenceFrame.LOCAL))
        datas.append(models[-1].createData())
    pin.initConstraintDynamics(model, data, models, datas)
    for (q, v), step in zip(states, steps, strict=True):
        torque, settings = np.array(step.torque), pin.ProximalSettings(1e-13, 1e-10, 50)
        began = perf_counter()
        a = pin.constraintDynamics(model, data, q, v, torque, models, datas, settings)
        spent.append(perf_counter() - began)
        found.append(np.array(a))
    return _off(found, steps), 1e6 * float(np.median(spent))


def _by_mujoco(
    robot: Robot, text: str, states: list[tuple[Array, Array]], steps: list[wbc.Step]
) -> tuple[float, float]:
    """(relative error of accelerations, median time of ``mj_forward`` [us]), its constraints as stiff as they go."""
    model = mujoco.MjModel.from_xml_string(text)
    model.eq_solimp[:, :3] = 0.9999, 0.9999, 1e-6
    model.opt.tolerance, model.opt.iterations = 1e-14, 200
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data, joints, spent, found = mujoco.MjData(model), wbc.robots.MujocoJoints(model, robot), [], []
    for (q, v), step in zip(states, steps, strict=True):
        joints.put_q(data.qpos, q)
        joints.put_v(data.qvel, q, v)
        joints.put_v(data.qfrc_applied, q, np.array(step.torque))
        began = perf_counter()
        mujoco.mj_forward(model, data)
        spent.append(perf_counter() - began)
        found.append(joints.v(data.qpos, data.qacc))
    return _off(found, steps), 1e6 * float(np.median(spent))


def _ours(robot: Robot, frame: str, targets: list[Array]) -> tuple[float, float, float]:
    """(median time of a native tick [us], of ``controller.step(q)`` [us], what the loops are open by at most [m])."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.EndEffector(frame), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3).add(wbc.tasks.JointLimits(acceleration=False))
    controller = stack.compile(backend="native")
    tick = core_of(controller).tick
    assert isinstance(tick, NativeTick)
    spent, reached = np.full((2 * ROUNDS, TICKS), np.inf), []
    for turn in range(2 * ROUNDS):
        controller.reset(robot.neutral)
        q = robot.neutral
        for k in range(TICKS):
            if k % EACH == 0:
                controller["hand"].target = robot.pose(targets[k // EACH], frame)
                controller["posture"].target = targets[k // EACH]
            if turn % 2:
                began = perf_counter()
                controller.step(q)
            else:
                tick.q[:] = q
                began = perf_counter()
                tick.step_function(tick.pointer)
            spent[turn, k] = perf_counter() - began
            q = pin.integrate(robot.model, q, controller.last_command * DT)
            reached.append(q)
    # Afterwards: between ticks it would empty the processor's cache, of a robot with loops alone
    native, calls = (1e6 * float(np.median(spent[which::2].min(axis=0))) for which in (0, 1))
    return native, calls, max(_gap(robot, q) for q in reached)


def _gap(robot: Robot, q: Array) -> float:
    return max(robot.loop_gaps(q).values(), default=0.0)


def _mink(robot: Robot, name: str, targets: list[Array]) -> tuple[float, float]:
    """The same of a posture with mink's equality constraint, by DAQP; NaN where mink is not installed."""
    if importlib.util.find_spec("mink") is None:
        return np.nan, np.nan
    import mink

    model = mujoco.MjModel.from_xml_string(NAMED[name])
    joints = wbc.robots.MujocoJoints(model, robot)
    configuration = mink.Configuration(model)
    posture = mink.PostureTask(model, cost=1.0, gain=GAIN * DT)
    constraint = mink.EqualityConstraintTask(model, cost=1.0)
    single = [joint for joint in robot.joint_names if robot.dofs(joint).stop - robot.dofs(joint).start == 1]
    limits = [mink.VelocityLimit(model, dict.fromkeys(single, np.array([SPEED])))]
    data, spent, gap = mujoco.MjData(model), np.zeros(TICKS), 0.0
    joints.put_q(data.qpos, robot.neutral)
    configuration.update(data.qpos)
    for k in range(TICKS):
        if k % EACH == 0:
            joints.put_q(data.qpos, targets[k // EACH])
            posture.set_target(data.qpos)
        began = perf_counter()
        v = mink.solve_ik(configuration, [posture], DT, "daqp", limits=limits, constraints=[constraint])
        spent[k] = perf_counter() - began
        configuration.integrate_inplace(v, DT)
        gap = max(gap, _gap(robot, joints.q(configuration.q)))
    return 1e6 * float(np.median(spent)), gap


def _pinocchio(robot: Robot, targets: list[Array]) -> tuple[float, float]:
    """The same of a posture in the null space of the loops' Jacobian, which Pinocchio's frames give, in numpy; what is
    open is fed back.
    """
    model, data = robot.model, robot.model.createData()
    loops = [[model.getFrameId(f"{loop.name}:{side}") for side in "ab"] for loop in robot.loops.loops]
    loops = [ends for ends in loops if max(ends) < model.nframes]
    q, spent, gap = robot.neutral, np.zeros(TICKS), 0.0
    for k in range(TICKS):
        wanted = GAIN * pin.difference(model, q, targets[k // EACH])
        began = perf_counter()
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        ends = [[pin.getFrameJacobian(model, data, frame, axes)[:3] for frame in pair] for pair in loops]
        jacobian = np.concatenate([b - a for a, b in ends])
        error = np.concatenate([data.oMf[b].translation - data.oMf[a].translation for a, b in loops])
        inverse = np.linalg.pinv(jacobian, rcond=1e-7)
        v = np.clip(wanted, -SPEED, SPEED)
        v = v - inverse @ (jacobian @ v + error / DT)
        spent[k] = perf_counter() - began
        q = pin.integrate(model, q, v * DT)
        gap = max(gap, float(np.abs(error).max()))
    return 1e6 * float(np.median(spent)), gap
