"""Keeps what a walk does, tick by tick: the log, and beside it what the controller said."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from wbc.log import FileWriter
from wbc.multibody import pin
from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import SPACING, BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import CLOSED, HAND_STATES, OPEN, OPENING, PART, WalkLog, WalkLogError
from wbc.walking.log.recorder import LogRecorder
from wbc.walking.log.ticks import TICK, TickColumns
from wbc.walking.loop.walk import Event, Tick, Walk
from wbc.walking.planner.plan import Plan, Regrasp

#: Ticks that are put together, and written, at once
CHUNK = 50
#: A row of the log: t, q, v, command
_Kept = tuple[float, Array, Array, Array]
#: States and holds of the hands, and whether the body is fixed
_Hands = tuple[list[int], list[int], bool]


@dataclass(frozen=True, eq=False)
class Before:
    """What was walked before a walk goes on: a log and its ticks, of which ``count`` rows count, and all its holds."""

    log: WalkLog
    ticks: TickColumns
    count: int
    structure: Structure


class WalkRecorder:
    """Records a :class:`Walk` from where it is; call :meth:`tick` after each of its ticks.

    A row of the log is the state as a tick begins and the rates that last until the next; :meth:`log` adds the last
    state, with the rates with which it goes on (:attr:`Machine.lasting`). An opening hand is logged on the hold that it
    leaves.

    Args:
        meta: plain data for the log.
        folder: gets ``run.part``, which has all ticks but the last :data:`CHUNK` at any time; None: nothing is written.
        before: the log begins with it.

    Raises:
        WalkLogError: the folder cannot be written. ShapeError: another machine walked before.
    """

    def __init__(
        self,
        walk: Walk,
        seed: int = 0,
        meta: Mapping[str, Any] | None = None,
        *,
        folder: str | os.PathLike[str] | None = None,
        before: Before | None = None,
    ) -> None:
        walker = walk.walker
        names = [arm.name for arm in walker.arms]
        self._walk, self._arms = walk, {name: k for k, name in enumerate(names)}
        self._structure = walk.structure if before is None else before.structure
        self._recorder = LogRecorder(
            self._structure,
            [joint for arm in walker.arms for joint in arm.joints],
            names,
            [arm.hand for arm in walker.arms],
            dt=walk.dt,
            seed=seed,
            robot=walker.robot.name,
            robot_digest=walker.data.digest,
            meta=meta,
        )
        self._time, self._q = walk.time, walk.q.copy()
        self._states = [CLOSED if arm in walk.held else OPEN for arm in range(len(names))]
        self._holds = [self._row(walk.held.get(k, -1)) for k in range(len(names))]
        if walk.opens is not None:
            arm, hold = walk.opens
            self._states[arm], self._holds[arm] = OPENING, self._row(hold)
        self._seen = len(walk.events)
        self._command = np.array(pin.SE3ToXYZQUAT(walk.plan.path.at(walk.path_time)[0]))
        # Ticks as they come; they are put together by the chunk, which takes a tenth of the time
        self._kept: list[_Kept] = []
        # Hands that change, with the row of the chunk from which on
        self._hands: list[tuple[int, _Hands]] = [(0, (self._states, self._holds, walk.machine.fixed))]
        self._rows: list[tuple[float, float, float, float, bool]] = []
        self._last: tuple[Any, Any, Any] = ((), (), None)
        self._count = 0
        if before is not None:
            self._recorder.begin_with(before.log, before.ticks, before.count)
        self._ticks = self._recorder.ticks
        if folder is not None:
            self._ticks.write_to(FileWriter(pathlib.Path(folder) / PART, overwrite=True, error=WalkLogError))
        #: that the writer has not got yet
        self._tables: dict[str, Array] | None = self._recorder.tables()

    def __len__(self) -> int:
        return self._count

    def tick(self, tick: Tick, command: Array | None = None) -> None:
        """Keeps the tick that was just made.

        Args:
            command: the twist that was commanded ``[6]``; None: the pose that the tick has.
        """
        walk = self._walk
        if len(walk.events) > self._seen:
            for event in walk.events[self._seen :]:
                self._happened(event)
            self._seen = len(walk.events)
        self._command = tick.target if command is None else command
        self._keep(tick.rates, tick.fixed)
        self._count += 1
        self._rows.append((walk.progress.travelled, tick.body_error, tick.slip, tick.cost, tick.status == "solved"))
        self._time, self._q = tick.time, tick.q
        found = tick.hands, tick.holds, walk.structure
        if found != self._last:
            self._take(tick)
            self._last = found
        if len(self._rows) == CHUNK:
            self.write()

    def log(self) -> tuple[WalkLog, TickColumns]:
        """What was recorded so far; afterwards nothing more can be.

        Raises:
            ShapeError: no tick was recorded.
        """
        self._keep(self._walk.machine.lasting, self._walk.machine.fixed)
        self.write()
        self._ticks.close()
        columns = self._ticks.log(self._recorder.tables())
        return WalkLog.of(columns), TickColumns.of(columns)

    def write(self) -> None:
        """What was kept since the last time becomes rows of the log, and is written to the folder, if there is one."""
        if not self._kept:
            return
        rows, hands = zip(*self._hands, strict=True)
        lasting = np.diff([*rows, len(self._kept)])
        states, holds, fixed = (np.repeat(np.array(column), lasting, axis=0) for column in zip(*hands, strict=True))
        begin = 0
        # Of a state that no step follows nothing is said
        said = np.zeros((len(self._kept), len(TICK)))
        said[: len(self._rows)] = np.reshape(self._rows, (-1, len(TICK)))
        # Commands may be twists first and poses after an abort
        for _, same in groupby(self._kept, key=lambda kept: len(kept[3])):
            times, *numbers = zip(*same, strict=True)
            q, v, command = (np.concatenate(column).reshape(len(times), -1) for column in numbers)
            part = slice(begin, begin := begin + len(times))
            now = states[part], holds[part], command, fixed[part], said[part]
            self._recorder.extend(np.array(times), q[:, :7], q[:, 7:], v[:, 6:], v[:, :6], *now)
        self._ticks.send(self._tables)
        self._kept, self._rows, self._hands, self._tables = [], [], [(0, self._hands[-1][1])], None

    def _row(self, hold: int) -> int:
        """The log's row of a hold of the walk's structure, which loses holds that vanish; -1 for none."""
        return -1 if hold < 0 else self._structure.index(self._walk.structure.ids[hold])

    def _happened(self, event: Event) -> None:
        """A hand that is lifted opens from its hold; one whose hold vanishes is open at once."""
        self._states, self._holds, self._last = [*self._states], [*self._holds], ((), (), None)
        if event.what == "lift":
            arm = self._arms[event.arm]
            self._states[arm], self._holds[arm] = OPENING, self._structure.index(event.hold)
        elif event.what == "vanished":
            self._recorder.vanish(event.time, event.hold)
            self._tables = self._recorder.tables()
            row = self._structure.index(event.hold)
            for arm in [arm for arm, hold in enumerate(self._holds) if hold == row]:
                self._states[arm], self._holds[arm] = OPEN, -1

    def _keep(self, v: Array, fixed: bool) -> None:
        """The row of the log that is now, with its rates."""
        states, holds, was = self._hands[-1][1]
        if states is not self._states or holds is not self._holds or was != fixed:
            self._hands.append((len(self._kept), (self._states, self._holds, fixed)))
        self._kept.append((self._time, self._q, v, self._command))

    def _take(self, tick: Tick) -> None:
        """What hands do and where, after a tick."""
        self._states = [HAND_STATES.index(state) for state in tick.hands]
        now = [self._row(hold) for hold in tick.holds]
        leaving = [state == OPENING for state in self._states]
        self._holds = [old if leaves else new for old, new, leaves in zip(self._holds, now, leaving, strict=True)]


def configuration(walker: Walker, log: WalkLog, row: int) -> Array:
    """The robot's configuration at a row of a log, in the structure's frame."""
    q = np.array(walker.robot.neutral)
    q[:7] = log.pose_body_in_structure[row]
    column = {name: k for k, name in enumerate(log.joints)}
    for arm in walker.arms:
        q[arm.q] = log.q[row, [column[joint] for joint in arm.joints]]
    return q


def as_walked(log: WalkLog, ticks: TickColumns, steps: Sequence[Regrasp]) -> tuple[Plan, TickColumns]:
    """A plan whose path is that of the logged body, over the time of the log; and ticks that say so.

    Args:
        steps: re-grasps that were begun.
    """
    stride = max(round(SPACING / log.dt), 1)
    poses = [pin.XYZQUATToSE3(row).homogeneous for row in log.pose_body_in_structure[::stride]]
    path = BodyPath(np.array(poses), stride * log.dt)
    closed = [np.flatnonzero(log.hand_state[:, arm] == CLOSED) for arm in range(len(log.arms))]
    start = tuple(log.hold_id[log.hand_hold[rows[0], arm]] if len(rows) else "" for arm, rows in enumerate(closed))
    time = np.minimum(log.t[1:] - log.t[0], path.duration)
    return Plan(path, start, tuple(steps), True, path.duration), replace(ticks, path_time=time)
