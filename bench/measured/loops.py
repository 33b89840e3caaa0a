"""Ticks of mechanisms with closed loops, beside those of their trees, mink's constraint and Pinocchio's Jacobians."""

from __future__ import annotations

import importlib.util
from time import perf_counter

import mujoco
import numpy as np
import pinocchio as pin

import wbc
from bench.sheet import Sheet, us
from tests.loops.mechanisms import NAMED
from wbc.controller import core_of
from wbc.robot import Robot
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Frame that is moved of each mechanism, ticks, how often they are walked, and time of a tick [s]
MOVED = {"four_bar": "coupler", "ankle": "foot", "gripper": "left_finger", "delta": "plate", "jansen": "leg"}
TICKS, ROUNDS, DT = 600, 3, 0.005
#: Ticks towards one target; gain of postures [1/s] and the fastest that joints move [rad/s, m/s]
EACH, GAIN, SPEED = 60, 5.0, 3.0


def parts() -> dict[str, Sheet | str]:
    """A row a mechanism."""
    rows = []
    for name in MOVED:
        robot = wbc.robots.load(NAMED[name], shapes="none").with_limits(velocity=SPEED)
        targets = [robot.random(seed) for seed in range(TICKS // EACH)]
        own, gap = _ours(robot, MOVED[name], targets)
        tree, _ = _ours(robot.with_loops(), MOVED[name], targets)
        found = [own, gap, *_mink(robot, name, targets), *_pinocchio(robot, targets)]
        shown = [us(value) if k % 2 == 0 else f"{value:.0e}" for k, value in enumerate(found)]
        size = f"{robot.nv}, {len(robot.loops.rows)}"
        rows.append((name, size, us(tree), *(text.replace("nan", "not installed") for text in shown)))
    head = ("mechanism", "dofs, loop rows", "tick of its tree [us]", "tick [us]", "open [m]", "mink [us]", "open [m]")
    return {"ticks": Sheet("", (*head, "Pinocchio and numpy [us]", "open [m]"), rows)}


def _ours(robot: Robot, frame: str, targets: list[Array]) -> tuple[float, float]:
    """(median time of a native tick [us], what the loops are open by at most [m])."""
    stack = wbc.Stack(robot, DT).add(wbc.tasks.EndEffector(frame), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3).add(wbc.tasks.JointLimits(acceleration=False))
    controller = stack.compile(backend="native")
    tick = core_of(controller).tick
    assert isinstance(tick, NativeTick)
    spent, gap = np.full((ROUNDS, TICKS), np.inf), 0.0
    for turn in range(ROUNDS):
        controller.reset(robot.neutral)
        q = robot.neutral
        for k in range(TICKS):
            if k % EACH == 0:
                controller["hand"].target = robot.pose(targets[k // EACH], frame)
                controller["posture"].target = targets[k // EACH]
            tick.q[:] = q
            began = perf_counter()
            tick.step_function(tick.pointer)
            spent[turn, k] = perf_counter() - began
            q = pin.integrate(robot.model, q, controller.last_command * DT)
            gap = max(gap, _gap(robot, q))
    return 1e6 * float(np.median(spent.min(axis=0))), gap


def _gap(robot: Robot, q: Array) -> float:
    return float(np.abs(robot._closing.look(q)[0]).max()) if robot.loops else 0.0


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
