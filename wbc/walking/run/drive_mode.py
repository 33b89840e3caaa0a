"""Velocity mode from commands: rates from a file, a keyboard or a function."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from wbc.multibody import pin
from wbc.robots import Walker
from wbc.track.summary import Figure
from wbc.validation import Array
from wbc.walking.body_path import standing_path
from wbc.walking.log.log import WalkLog
from wbc.walking.log.ticks import TickColumns
from wbc.walking.loop.walk import Walk
from wbc.walking.modes.commands import Commands, read_commands
from wbc.walking.modes.drive import Drive, standing_plan
from wbc.walking.planner.plan import Plan
from wbc.walking.run.carrying_out import CarryingOut, Progress
from wbc.walking.run.mode import Ending, Mode, Result
from wbc.walking.run.plausible import ground
from wbc.walking.run.recording import WalkRecorder, as_walked
from wbc.walking.run.request import DriveRequest

#: Time that the body has to come to rest after the last command [s]
COMING_DOWN = 30.0
#: Ticks over which achieved rates are means
WINDOW = 50


class DriveMode(Mode[DriveRequest]):
    """Drives a body over the place where the request begins, until the commands are over and everything is at rest.

    Args:
        commands: asked every tick; default: those of the request's file.

    Raises:
        ShapeError: another machine. NumberTableError, RangeError: a bad file. What the request's methods raise.
    """

    def __init__(self, request: DriveRequest, walker: Walker, commands: Commands | None = None) -> None:
        super().__init__(walker)
        data = walker.arm_data
        self.request, self.structure = request, ground(request.site, walker)
        self._pose = request.beginning(data)
        self.path = standing_path(self._pose)
        self._commands = read_commands(request.commands) if commands is None else commands

    def plan(self) -> Plan:
        """To stand, on holds that leave some freedom to go anywhere."""
        return standing_plan(self.walker, self.structure, self._pose)

    def carry_out(
        self, walk: Walk, recorder: WalkRecorder, report: Progress, stop: Callable[[], bool] | None
    ) -> Ending:
        """Until the commands are over and the body stands."""
        self._drive = drive = Drive(walk)
        self._doing = doing = CarryingOut(walk, recorder, tick=drive.tick, progress=report, stop=stop)
        end, reasons = np.inf, list[str]()
        while walk.time < end and not (end < np.inf and drive.standing and len(walk.held) == len(walk.walker.arms)):
            rates = self._commands.rates(walk.time) if end == np.inf else None
            if rates is None and end == np.inf:
                end = walk.time + COMING_DOWN
            drive.steer(*(np.zeros(3) if rates is None else rates))
            command = np.array([*drive.command[:2], 0.0, 0.0, 0.0, drive.command[2]])
            if not doing.step(command=command):
                return Ending(doing.outcome or "time", doing.reason)
            if drive.reason and drive.reason not in reasons:
                reasons.append(drive.reason)
        return Ending("time", "; ".join(reasons))

    def figures(self, log: WalkLog | None) -> tuple[Figure, ...]:
        """Commanded and achieved rates, and how far things go after an abort."""
        achieved = [] if log is None else self._achieved(log)
        return (*achieved, *self._doing.summary())

    def result(self, walk: Walk, log: WalkLog, ticks: TickColumns) -> Result:
        """The plan is the path that the body took."""
        plan, ticks = as_walked(log, ticks, walk.progress.steps)
        return Result(plan, log, ticks, self.figures(log))

    def _achieved(self, log: WalkLog) -> list[Figure]:
        """Commanded and achieved rates, and what is between them."""
        if len(log) <= WINDOW:
            return []
        matrices, spacing = [_matrix(row) for row in log.pose_body_in_structure[::WINDOW]], WINDOW * log.dt
        found = np.array([self._drive.steering.rates(a, b, spacing)[:3] for a, b in pairwise(matrices)])
        asked = np.array([log.command[k : k + WINDOW].mean(axis=0) for k in range(0, len(found) * WINDOW, WINDOW)])
        asked = asked[:, [0, 1, 5]]
        off, speed = np.linalg.norm(found[:, :2] - asked[:, :2], axis=1), np.linalg.norm(asked[:, :2], axis=1)
        value = {"commanded": float(speed.mean()), "deviation": float(off.mean()), "worst": float(off.max())}
        means = f"means over {spacing:g} s"
        text = f"commanded {value['commanded']:.4f} m/s, deviation {value['deviation']:.4f} m/s, {means}"
        return [Figure("drive", "commands", value, text)]


def _matrix(row: Array) -> Array:
    return np.asarray(pin.XYZQUATToSE3(row).homogeneous)
