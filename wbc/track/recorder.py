"""Collecting what every tick did, in arrays made beforehand."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from wbc.controller import Controller, Status, Step, core_of
from wbc.track.setup import Plan
from wbc.validation import Array

STATUSES = tuple(Status)
POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


class Recorder:
    """Columns of a run that grow by one tick with each :meth:`add`."""

    def __init__(self, plan: Plan, controller: Controller) -> None:
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
