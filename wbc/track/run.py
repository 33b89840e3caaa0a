"""The loop over ticks: command, record, let the robot move.

The robot of a run is a plant (:mod:`wbc.simulation`). Unless another one is given it does exactly what it is commanded,
so that the log shows the controller's command without the lag, delay and noise of a real robot's servos. The
configuration of each tick is read from it, the velocity is the last command, not the measured one.

The target of tick k is the path's pose at t_k, the feed-forward its twist at the middle of the interval,
t_k + dt/2, which is what v is held for.
"""

from __future__ import annotations

import importlib.metadata
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.api import Controller
from wbc.controller import Status, Step, core_of
from wbc.shapes import Sphere
from wbc.simulation import Connection, Plant
from wbc.track.clearance import clearances, least_mesh_clearance
from wbc.track.log import Log
from wbc.track.setup import PathRun
from wbc.validation import Array

VERSIONS = ("wbc", "casadi", "pin", "daqp", "osqp", "numpy")
STATUSES = tuple(Status)
#: A run is asked what stood in its way where the frame is farther from its target than this [m]
MISSED = 1e-3
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def track(
    plan: PathRun,
    progress: Callable[[int], None] | None = None,
    stop: Callable[[], bool] | None = None,
    compiled: Callable[[Controller], None] | None = None,
    *,
    plant: Plant | None = None,
) -> Log:
    """Do a run and return its log.

    Args:
        plan: what to do.
        progress: called with the number of finished ticks after each.
        stop: asked before each tick; True ends the run there, with a log of what was done.
        compiled: called once when the controller is ready.
        plant: what moves; default: a :class:`wbc.simulation.KinematicPlant`.

    Raises:
        WbcError: the stack does not fit the robot, or it does not compile. What
            :class:`wbc.simulation.Connection` raises of the plant.
    """
    validation.instance("plan", plan, PathRun, "a PathRun")
    for name, one in (("progress", progress), ("stop", stop), ("compiled", compiled)):
        validation.function(name, one)
    connection = Connection(plant, plan.robot, plan.dt)
    began = time.perf_counter()
    controller = plan.stack().compile(solver=plan.solver, backend=plan.backend)
    compile_time = time.perf_counter() - began
    if compiled is not None:
        validation.called("compiled", compiled, controller)
    recorder = RunRecorder(plan, controller)
    with connection:
        _loop(plan, controller, connection, recorder, progress, stop)
    columns, units = recorder.columns()
    robot, obstacles, t = plan.robot, plan.obstacles, recorder.times
    gaps = clearances(robot, recorder.q, obstacles, t)
    for name, values in gaps.items():
        columns[f"clearance.{name}"], units[f"clearance.{name}"] = values, "m"
    meta = _meta(plan, controller, recorder, compile_time)
    if plant is not None:
        meta["integration"] = f"plant {type(plant).__name__}"
    if recorder.worst is not None:
        when, step = recorder.worst
        said = [str(reason) for reason in step.explain().reasons if reason.task == "hand"]
        meta["hindrance"] = {"t": when, "text": " ".join(said)}
    nearest = least_mesh_clearance(robot, recorder.q, obstacles, t, gaps)
    if nearest is not None:
        meta["mesh_clearance"] = dict(zip(("least", "link", "t"), nearest, strict=True))
    return Log(columns, units, meta)


def _loop(
    plan: PathRun,
    controller: Controller,
    connection: Connection,
    recorder: RunRecorder,
    progress: Callable[[int], None] | None,
    stop: Callable[[], bool] | None,
) -> None:
    dt, duration = plan.dt, plan.path.duration
    q = connection.reset(plan.start).q
    controller.reset(q)
    for name in plan.obstacles:
        controller[name].rate = min(plan.approach, 1.0 / controller.stack.dt_range[1])
    rest = float(controller["plane"].target) if plan.plane is not None else 0.0
    clock = time.perf_counter_ns
    for k in range(plan.ticks):
        if stop is not None and validation.called("stop", stop):
            break
        t = k * dt
        target, middle = plan.path.sample(t).pose, plan.path.sample(t + dt / 2).twist
        if plan.kind == "position":
            controller["hand"].set(target=target.translation, feedforward=middle[:3])
        else:
            controller["hand"].set(target=target, feedforward=middle)
        angle = math.nan
        if plan.plane is not None:
            angle = rest + plan.plane.at(t, duration)[0]
            controller["plane"].target = angle
            controller["plane"].feedforward = plan.plane.at(t + dt / 2, duration)[1]
        for name, obstacle in plan.obstacles.items():
            if obstacle.velocity.any():
                controller[name].pose = obstacle.at(t)
                controller[name].velocity = np.concatenate([obstacle.velocity, np.zeros(3)])
        start = clock()
        step = controller.step(q)
        recorder.add(t, q, target, angle, step, (clock() - start) * 1e-9)
        q = connection.drive(step.v).q
        if progress is not None:
            validation.called("progress", progress, k + 1)


def _meta(plan: PathRun, controller: Controller, recorder: RunRecorder, compile_time: float) -> dict[str, Any]:
    robot, limits = plan.robot, plan.robot.limits
    arrays = {
        "position_lower": limits.position_lower,
        "position_upper": limits.position_upper,
        "velocity": limits.velocity,
        "acceleration": limits.acceleration,
    }
    return {
        "robot": robot.name,
        "source": robot.source,
        "frame": plan.frame,
        "kind": plan.kind,
        "path": plan.label,
        "duration": plan.path.duration,
        "ticks": recorder.count,
        "planned": plan.ticks,
        "interrupted": recorder.count < plan.ticks,
        "dt": plan.dt,
        "integration": "q <- q (+) v dt, open loop",
        "solver": controller.solver,
        "backend": controller.backend,
        "cached": controller.cached,
        "compile_time": compile_time,
        "stack": str(controller),
        "margin": plan.margin,
        "approach": plan.approach,
        "plane": None if plan.plane is None else {"amplitude": plan.plane.amplitude, "cycles": plan.plane.cycles},
        "holds": list(plan.holds),
        "obstacles": {
            name: {
                "shape": repr(o.shape),
                "radius": o.shape.radius if isinstance(o.shape, Sphere) else None,
                "pose": np.asarray(o.pose.homogeneous).tolist(),
                "velocity": o.velocity.tolist(),
            }
            for name, o in plan.obstacles.items()
        },
        "dofs": list(robot.dof_names),
        "dof_units": list(robot.dof_units),
        "position_index": [int(i) for i in robot.position_index],
        "limits": {name: [None if math.isinf(x) else float(x) for x in array] for name, array in arrays.items()},
        "versions": {name: importlib.metadata.version(name) for name in VERSIONS},
    }


class RunRecorder:
    """Columns of a run that grow by one tick with each :meth:`add`."""

    def __init__(self, plan: PathRun, controller: Controller) -> None:
        n, robot = plan.ticks, plan.robot
        self._plan = plan
        self._data = robot.model.createData()
        self._frame = int(robot.model.getFrameId(plan.frame))
        blocks = core_of(controller).layout.blocks
        self._tasks = {name: b.rows for name, b in blocks.items() if b.form == "task"}
        self._margins = {name: b.rows for name, b in blocks.items() if b.form == "margins"}
        self.count = 0
        self._t = np.zeros(n)
        self._q, self._v = np.zeros((n, robot.nq)), np.zeros((n, robot.nv))
        self._pose, self._target = np.zeros((n, 7)), np.zeros((n, 7))
        self._errors = {name: np.zeros((n, len(rows))) for name, rows in self._tasks.items()}
        self._heights = {name: np.zeros((n, len(rows))) for name, rows in self._margins.items()}
        self._plane = np.full(n, math.nan)
        self._faded = np.zeros(n, dtype=bool)
        self._status, self._iterations = np.zeros(n, dtype=np.int8), np.zeros(n, dtype=np.int32)
        self._bound, self._tick = np.zeros(n), np.zeros(n)
        self._binding: dict[str, Array] = {}
        self._relaxed: dict[str, Array] = {}
        self._relaxed_units: dict[str, str] = {}
        #: time and step of the tick that was farthest from its target, None where all were near
        self.worst: tuple[float, Step] | None = None
        self._farthest = MISSED

    @property
    def q(self) -> Array:
        """Configurations so far."""
        return self._q[: self.count]

    @property
    def times(self) -> Array:
        """Times so far [s]."""
        return self._t[: self.count]

    def add(self, t: float, q: Array, target: pin.SE3, angle: float, step: Step, seconds: float) -> None:
        """Record a tick; it counts only when all of it is written."""
        k, n = self.count, len(self._t)
        self._t[k], self._q[k], self._v[k] = t, q, step.v
        pin.framesForwardKinematics(self._plan.robot.model, self._data, q)
        self._pose[k] = pin.SE3ToXYZQUAT(self._data.oMf[self._frame])
        self._target[k] = pin.SE3ToXYZQUAT(target)
        off = float(np.linalg.norm(self._pose[k, :3] - self._target[k, :3]))
        if off > self._farthest:
            self._farthest, self.worst = off, (t, step)
        for name, residual in step.residuals.items():
            self._errors[name][k] = residual.values
        for name, margins in step.margins.items():
            self._heights[name][k] = margins
        self._plane[k] = angle
        self._faded[k] = "plane" in step.faded
        self._status[k] = STATUSES.index(step.status)
        self._iterations[k] = step.iterations
        self._bound[k], self._tick[k] = step.certificate.error_bound, seconds
        for row in step.binding:
            self._binding.setdefault(str(row), np.zeros(n, dtype=bool))[k] = True
        for slack in step.relaxed:
            label = f"{slack.item}/{slack.row}"
            self._relaxed_units[label] = slack.unit
            self._relaxed.setdefault(label, np.zeros(n))[k] = slack.amount
        self.count = k + 1

    def columns(self) -> tuple[dict[str, np.ndarray], dict[str, str]]:
        """(columns, units) of the ticks so far; see :class:`wbc.track.Log`."""
        robot, dt = self._plan.robot, self._plan.dt
        out: dict[str, np.ndarray] = {}
        units: dict[str, str] = {}

        def put(name: str, values: np.ndarray, unit: str = "") -> None:
            out[name], units[name] = values[: self.count].copy(), unit

        put("t", self._t, "s")
        coordinates = {int(i): k for k, i in enumerate(robot.position_index) if i >= 0}
        for i in range(robot.nq):
            dof = coordinates.get(i)
            name = str(i) if dof is None else robot.dof_names[dof]
            put(f"q.{name}", self._q[:, i], "" if dof is None else robot.dof_units[dof])
        before = np.vstack([np.zeros(robot.nv), self._v[:-1]])
        for k, (name, unit) in enumerate(zip(robot.dof_names, robot.dof_units, strict=True)):
            put(f"v.{name}", self._v[:, k], f"{unit}/s")
            put(f"a.{name}", (self._v[:, k] - before[:, k]) / dt, f"{unit}/s^2")
        for k, name in enumerate(POSE):
            put(f"pose.{name}", self._pose[:, k], "m" if k < 3 else "")
            put(f"target.{name}", self._target[:, k], "m" if k < 3 else "")
        for task, rows in self._tasks.items():
            for k, row in enumerate(rows):
                put(f"error.{task}.{row.label}", self._errors[task][:, k], row.unit)
        if self._plan.plane is not None:
            put("plane.command", self._plane, "rad")
            put("plane.angle", self._plane + self._errors["plane"][:, 0], "rad")
            put("plane.faded", self._faded)
        for item, rows in self._margins.items():
            for k, row in enumerate(rows):
                put(f"margin.{item}.{row.label}", self._heights[item][:, k], row.unit)
        put("status", self._status)
        put("iterations", self._iterations)
        put("error_bound", self._bound, "rad/s")
        put("tick", self._tick, "s")
        for label, flags in sorted(self._binding.items()):
            put(f"binding.{label}", flags)
        for label, amounts in sorted(self._relaxed.items()):
            put(f"relaxed.{label}", amounts, self._relaxed_units[label])
        return out, units
