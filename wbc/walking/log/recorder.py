"""Records a walk tick by tick."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import __version__, extras, validation
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.log import TickRecorder
from wbc.multibody import is_pose, pin
from wbc.validation import Array
from wbc.walking.holds.hold import FIXED, FREE
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import FORMAT, NAMES, WalkLog, columns_of
from wbc.walking.log.ticks import TICK, TickColumns

#: Packages whose versions a log states, beside this one's
PACKAGES = ("numpy", "pin", "casadi", "daqp")
#: What ``WalkLog.hold_roll`` has for rolls that are no number
ROLLS: Mapping[Any, int] = {FREE: 0, FIXED: 1}
#: Numbers of a command -> its index in ``COMMANDS``
_KINDS = {0: 0, 6: 1, 7: 2}


class LogRecorder:
    """Ticks of a walk.

        recorder = LogRecorder(structure, joints, arms, hands, dt=0.01, seed=0, robot="walker", robot_digest="...")
        recorder.append(t, q[:7], q[7:], v[6:], v[:6], states, holds)
        recorder.vanish(t, "13,12")
        recorder.log().save(folder)

    Args:
        structure: gives the table of holds; all are there from the start.
        joints: in the order of q. arms: names. hands: links of the URDF, one an arm.
        dt: time between ticks [s]. seed: of the run. robot: its name. robot_digest: of its data.
        meta: more plain data for ``WalkLog.meta``.

    Attributes:
        ticks: the rows as they are kept, and written while the walk goes on.

    Raises:
        ShapeError, RangeError: bad numbers.
    """

    def __init__(
        self,
        structure: Structure,
        joints: Sequence[str],
        arms: Sequence[str],
        hands: Sequence[str],
        *,
        dt: float,
        seed: int,
        robot: str,
        robot_digest: str,
        meta: Mapping[str, Any] | None = None,
        capacity: int = 2048,
    ) -> None:
        if isinstance(capacity, bool) or not isinstance(capacity, int) or capacity < 1:
            raise RangeError("capacity", capacity, "expected a whole number of at least 1")
        self._structure, self._names = structure, (tuple(joints), tuple(arms), tuple(hands))
        m, a = len(self._names[0]), len(self._names[1])
        said: dict[str, Any] = {
            "format": FORMAT,
            **(meta or {}),
            "robot": robot,
            "robot_digest": robot_digest,
            "structure": structure.name,
            "structure_digest": structure.digest,
            "dt": validation.scalar("dt", dt, low=0.0, open_low=True, unit="s"),
            "seed": seed,
            "versions": dict(versions()),
            **dict(zip(NAMES, map(list, (*self._names, structure.ids)), strict=True)),
        }
        columns = {name: of for parts in columns_of(*self._names[:2]).values() for name, of in parts.items()}
        self.ticks, self._lengths = TickRecorder(columns, said, capacity), (7, m, m, 6, a, a)
        self._spans: list[list[float]] = [[k, -inf, inf] for k in range(len(structure))]

    def __len__(self) -> int:
        return len(self.ticks)

    def append(
        self,
        t: float,
        pose: Any,
        q: Any,
        v: Any,
        twist: Any,
        states: Sequence[int] | NDArray[Any],
        holds: Sequence[int] | NDArray[Any],
        command: Any = None,
        body_fixed: bool = False,
    ) -> None:
        """One tick. The numbers are copied; whether they can be is checked by :meth:`log`.

        Args:
            pose: of the body, seven numbers or ``pin.SE3``. twist: six numbers along the body's axes.
            states: an index into ``HAND_STATES`` an arm. holds: a row of the structure an arm, -1 for none.
            command: None, a twist of six numbers or a pose of seven.

        Raises:
            ShapeError: arrays of another length; the tick is then not recorded.
        """
        numbers = pin.SE3ToXYZQUAT(pose) if is_pose(pose) else pose
        given = numbers, q, v, twist, states, holds, () if command is None else command
        p, q, v, twist, hands, places, asked = (np.array(values, dtype=float)[None] for values in given)
        self.extend(np.array([float(t)]), p, q, v, twist, hands, places, asked, np.array([body_fixed]))

    def extend(
        self,
        t: Array,
        pose: Array,
        q: Array,
        v: Array,
        twist: Array,
        states: NDArray[Any],
        holds: NDArray[Any],
        command: Array,
        body_fixed: NDArray[Any],
        ticks: Array | None = None,
    ) -> None:
        """n ticks at once: what :meth:`append` takes, by rows.

        Args:
            ticks: what the controller said of each step that follows, the fields of :class:`TickColumns`, n x 5.

        Raises:
            ShapeError: arrays of another shape; no tick is then recorded.
        """
        n, width = len(t), command.shape[-1]
        given = pose, q, v, twist, states, holds
        found = tuple(np.shape(rows) for rows in (t, *given, command, body_fixed))
        wanted = ((n,), *((n, length) for length in self._lengths), (n, width), (n,))
        if found != wanted or width not in _KINDS:
            raise ShapeError("ticks", found, f"expected {wanted}, a command of 0, 6 or 7 numbers")
        whole, kind = np.zeros((n, 7)), np.full((n, 1), float(_KINDS[width]))
        whole[:, :width] = command
        said = np.zeros((n, len(TICK))) if ticks is None else ticks
        self.ticks.extend(np.concatenate((t[:, None], *given, body_fixed[:, None], whole, kind, said), axis=1))

    def begin_with(self, log: WalkLog, ticks: TickColumns, count: int) -> None:
        """Take over the first ``count`` rows of a log of the same machine and holds. What vanished by then stays gone.

        Raises:
            ShapeError: another machine or other holds. RangeError: something is recorded already.
        """
        if len(self):
            raise RangeError("rows", len(self), "a log is gone on with from its beginning")
        if (log.joints, log.arms, log.hold_id) != (*self._names[:2], self._structure.ids):
            raise ShapeError("log", log.arms, "expected a log of the same machine on the same holds")
        columns = log.columns(ticks).columns.values()
        self.ticks.extend(np.stack([column[:count] for column in columns], axis=1))
        now = float(log.t[count])
        spans = zip(log.presence_hold.tolist(), log.presence_span.tolist(), strict=True)
        self._spans = [[row, start, end if end <= now else inf] for row, (start, end) in spans if start <= now]

    def tables(self) -> dict[str, Array]:
        """The holds, and when each was there."""
        holds = self._structure.holds
        poses = np.array([pin.SE3ToXYZQUAT(hold.pose) for hold in holds])
        rolls = np.array([ROLLS.get(hold.roll, hold.roll) for hold in holds], dtype=float)
        return {
            "holds": np.column_stack([poses, rolls, self._structure.tilts]),
            "presence": np.array(self._spans, dtype=float).reshape(-1, 3),
        }

    def vanish(self, t: float, hold: str) -> None:
        """A hold is gone from time ``t`` [s] on.

        Raises:
            UnknownNameError: no such hold, or it is gone already.
        """
        span = self._spans[self._open_span(hold, True)]
        span[2] = validation.scalar("t", t, unit="s")

    def appear(self, t: float, hold: str) -> None:
        """A hold that was gone is there again from time ``t`` [s] on.

        Raises:
            UnknownNameError: no such hold, or it is there.
        """
        self._open_span(hold, False)
        self._spans.append([self._structure.index(hold), validation.scalar("t", t, unit="s"), inf])

    def log(self) -> WalkLog:
        """What was recorded so far.

        Raises:
            ShapeError: fewer than two ticks, or names that do not fit. NotFiniteError, RangeError, RotationError: a
                tick that cannot be.
        """
        return WalkLog.of(self.ticks.log(self.tables()))

    def _open_span(self, hold: str, wanted: bool) -> int:
        """The span without end of a hold, if it is ``wanted``; -1 where there is none and none is."""
        row = self._structure.index(hold)
        found = [k for k, span in enumerate(self._spans) if span[0] == row and span[2] == inf]
        if bool(found) != wanted:
            there = {int(span[0]) for span in self._spans if span[2] == inf}
            choices = [name for k, name in enumerate(self._structure.ids) if (k in there) == wanted]
            raise UnknownNameError("hold", hold, choices)
        return found[0] if found else -1


@functools.cache
def versions() -> Mapping[str, str]:
    """Versions of this package and of :data:`PACKAGES`."""
    return {"wbc": __version__} | extras.versions(PACKAGES)
