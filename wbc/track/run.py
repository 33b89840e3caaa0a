"""The loop over ticks: command, record, let the robot move.

The robot of a run is a plant (:mod:`wbc.simulation`). Unless another one is given it does exactly what it is commanded,
so that the log shows the controller's command without the lag, delay and noise of a real robot's servos. The
configuration of each tick is read from it, the velocity is the last command, not the measured one.

The target of tick k is the path's pose at t_k, the feed-forward its twist at the middle of the interval,
t_k + dt/2, which is what v is held for.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from wbc import extras, validation
from wbc.api import Controller
from wbc.controller import Status, Step, core_of
from wbc.log import Log, TickRecorder
from wbc.multibody import pin
from wbc.shapes import Sphere
from wbc.simulation import Connection, Plant
from wbc.track.clearance import clearances, least_mesh_clearance
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
    log, robot, obstacles = recorder.log(), plan.robot, plan.obstacles
    q, t = log.array("q"), log["t"]
    gaps = clearances(robot, q, obstacles, t)
    columns = {**log.columns, **{f"clearance.{name}": values for name, values in gaps.items()}}
    units = {**log.units, **{f"clearance.{name}": "m" for name in gaps}}
    meta = _meta(plan, controller, recorder, compile_time)
    if plant is not None:
        meta["integration"] = f"plant {type(plant).__name__}"
    if recorder.worst is not None:
        when, step = recorder.worst
        said = [str(reason) for reason in step.explain().reasons if reason.task == "hand"]
        meta["hindrance"] = {"t": when, "text": " ".join(said)}
    nearest = least_mesh_clearance(robot, q, obstacles, t, gaps)
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
        "ticks": len(recorder),
        "planned": plan.ticks,
        "interrupted": len(recorder) < plan.ticks,
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
        "versions": extras.versions(VERSIONS),
    }


class RunRecorder:
    """Columns of a run that grow by one tick with each :meth:`add`.

    Attributes:
        worst: time and step of the tick that was farthest from its target, None where all were near.
    """

    def __init__(self, plan: PathRun, controller: Controller) -> None:
        self._plan, robot = plan, plan.robot
        self._data, self._frame = robot.model.createData(), int(robot.model.getFrameId(plan.frame))
        self._ticks = TickRecorder(_columns(plan, controller), {}, plan.ticks)
        self._binding: dict[str, list[int]] = {}
        self._relaxed: dict[tuple[str, str], list[tuple[int, float]]] = {}
        self.worst: tuple[float, Step] | None = None
        self._farthest = MISSED

    def __len__(self) -> int:
        return len(self._ticks)

    def add(self, t: float, q: Array, target: pin.SE3, angle: float, step: Step, seconds: float) -> None:
        """Record a tick; it counts only when all of it is written."""
        pin.framesForwardKinematics(self._plan.robot.model, self._data, q)
        pose, aim = (pin.SE3ToXYZQUAT(place) for place in (self._data.oMf[self._frame], target))
        off = float(np.linalg.norm(pose[:3] - aim[:3]))
        if off > self._farthest:
            self._farthest, self.worst = off, (t, step)
        errors = [residual.values for residual in step.residuals.values()]
        plane = [] if self._plan.plane is None else [angle, angle + step.residuals["plane"].values[0]]
        faded = [] if self._plan.plane is None else ["plane" in step.faded]
        ending = [STATUSES.index(step.status), step.iterations, step.certificate.error_bound, seconds]
        row = np.concatenate([[t], q, step.v, pose, aim, *errors, plane, faded, *step.margins.values(), ending])
        self._ticks.extend(row[None])
        tick = len(self) - 1
        for binds in step.binding:
            self._binding.setdefault(str(binds), []).append(tick)
        for slack in step.relaxed:
            self._relaxed.setdefault((f"{slack.item}/{slack.row}", slack.unit), []).append((tick, slack.amount))

    def log(self) -> Log:
        """The ticks so far; see :class:`wbc.log.Log`."""
        log, robot, n = self._ticks.log(), self._plan.robot, len(self)
        columns, units = dict(log.columns), dict(log.units)
        for name, unit in zip(robot.dof_names, robot.dof_units, strict=True):
            columns[f"a.{name}"] = np.diff(columns[f"v.{name}"], prepend=0.0) / self._plan.dt
            units[f"a.{name}"] = f"{unit}/s^2"
        for label, ticks in sorted(self._binding.items()):
            columns[f"binding.{label}"] = np.isin(np.arange(n), ticks)
            units[f"binding.{label}"] = ""
        for (label, unit), amounts in sorted(self._relaxed.items()):
            name = f"relaxed.{label}"
            columns[name], units[name] = np.zeros(n), unit
            columns[name][[k for k, _ in amounts]] = [amount for _, amount in amounts]
        return Log(columns, units, {})


def _columns(plan: PathRun, controller: Controller) -> dict[str, tuple[str, str]]:
    """What a row of a run has: name -> unit and kind of number."""
    robot, blocks = plan.robot, core_of(controller).layout.blocks.items()
    coordinates = {int(i): k for k, i in enumerate(robot.position_index) if i >= 0}
    units = {"t": "s"}
    for i in range(robot.nq):
        dof = coordinates.get(i)
        units[f"q.{i if dof is None else robot.dof_names[dof]}"] = "" if dof is None else robot.dof_units[dof]
    units |= {f"v.{name}": f"{unit}/s" for name, unit in zip(robot.dof_names, robot.dof_units, strict=True)}
    units |= {f"{what}.{k}": "m" if len(k) == 1 else "" for what in ("pose", "target") for k in POSE}
    units |= {f"error.{task}.{row.label}": row.unit for task, b in blocks if b.form == "task" for row in b.rows}
    if plan.plane is not None:
        units |= {"plane.command": "rad", "plane.angle": "rad", "plane.faded": ""}
    units |= {f"margin.{item}.{row.label}": row.unit for item, b in blocks if b.form == "margins" for row in b.rows}
    units |= {"status": "", "iterations": "", "error_bound": "rad/s", "tick": "s"}
    kinds = {"plane.faded": "?", "status": "i1", "iterations": "i4"}
    return {name: (unit, kinds.get(name, "f8")) for name, unit in units.items()}
