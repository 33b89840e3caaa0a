"""Records a walk tick by tick."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from math import inf
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc import __version__, validation
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.validation import Array
from wbc.walking.holds.hold import FIXED, FREE
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import FORMAT, PRESENCE, ROW, WalkLog, row_dtype
from wbc.walking.log.part import Records

#: Packages whose versions a log states, beside this one's
PACKAGES = ("numpy", "pin", "casadi", "daqp")
#: What ``WalkLog.hold_roll`` has for rolls that are no number
ROLLS: Mapping[Any, int] = {FREE: 0, FIXED: 1}
#: Numbers of a command -> its index in ``COMMANDS``
_KINDS = {0: 0, 6: 1, 7: 2}
#: Fields of a hold besides its id
_HOLD: list[Any] = [("hold_pose", "f8", 7), ("hold_roll", "i8"), ("hold_max_tilt", "f8")]


class LogRecorder:
    """Ticks of a walk, in arrays that double when they are full.

        recorder = LogRecorder(structure, joints, arms, hands, dt=0.01, seed=0, robot="walker", robot_digest="...")
        recorder.append(t, q[:7], q[7:], v[6:], v[:6], states, holds)
        recorder.vanish(t, "13,12")
        recorder.log().save(folder)

    Args:
        structure: gives the table of holds; all are there from the start.
        joints: in the order of q. arms: names. hands: links of the URDF, one an arm.
        dt: time between ticks [s]. seed: of the run. robot: its name. robot_digest: of its data.
        meta: more plain data for ``WalkLog.meta``.

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
        self._meta: dict[str, Any] = {
            **(meta or {}),
            "robot": robot,
            "robot_digest": robot_digest,
            "structure": structure.name,
            "structure_digest": structure.digest,
            "dt": validation.scalar("dt", dt, low=0.0, open_low=True, unit="s"),
            "seed": seed,
            "versions": dict(versions()),
        }
        self._dtype = row_dtype(m, a)
        self._rows, self._count, self._lengths = np.zeros(capacity, self._dtype), 0, (7, m, m, 6, a, a)
        self._spans: list[list[float]] = [[k, -inf, inf] for k in range(len(structure))]

    def __len__(self) -> int:
        return self._count

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
        k = self._count
        self._grow(1)
        numbers = pin.SE3ToXYZQUAT(pose) if isinstance(pose, pin.SE3) else pose
        given = () if command is None else command
        lengths = (len(numbers), len(q), len(v), len(twist), len(states), len(holds))
        if lengths != self._lengths or len(given) not in _KINDS:
            raise ShapeError(
                "tick",
                (*lengths, len(given)),
                f"expected {self._lengths} numbers of pose, q, v, twist, states, holds, and 0, 6 or 7 of the command",
            )
        whole = np.zeros(7)
        whole[: len(given)] = given
        hands = np.asarray(states), np.asarray(holds)
        self._rows[k] = (t, numbers, q, v, twist, *hands, bool(body_fixed), whole, _KINDS[len(given)])
        self._count = k + 1

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
    ) -> None:
        """n ticks at once: what :meth:`append` takes, by rows; every tick has a command, a twist or a pose.

        Raises:
            ShapeError: arrays of another shape; no tick is then recorded.
        """
        n, width = len(t), command.shape[-1]
        found = tuple(np.shape(rows) for rows in (t, pose, q, v, twist, states, holds, command, body_fixed))
        wanted = ((n,), *((n, length) for length in self._lengths), (n, width), (n,))
        if found != wanted or width not in (6, 7):
            raise ShapeError("ticks", found, f"expected {wanted}, a command of 6 or 7 numbers")
        self._grow(n)
        rows = self._rows[self._count : self._count + n]
        for name, values in zip(ROW, (t, pose, q, v, twist, states, holds, body_fixed), strict=False):
            rows[name] = values
        rows["command"][:, :width], rows["command"][:, width:] = command, 0.0
        rows["command_kind"] = _KINDS[width]
        self._count += n

    def begin_with(self, log: WalkLog, count: int) -> None:
        """Take over the first ``count`` rows of a log of the same machine and holds. What vanished by then stays gone.

        Raises:
            ShapeError: another machine or other holds. RangeError: something is recorded already.
        """
        if self._count:
            raise RangeError("rows", self._count, "a log is gone on with from its beginning")
        if (log.joints, log.arms, log.hold_id) != (*self._names[:2], self._structure.ids):
            raise ShapeError("log", log.arms, "expected a log of the same machine on the same holds")
        self._grow(count)
        for name in ROW:
            self._rows[name][:count] = getattr(log, name)[:count]
        self._count, now = count, float(log.t[count])
        spans = zip(log.presence_hold.tolist(), log.presence_span.tolist(), strict=True)
        self._spans = [[row, start, end if end <= now else inf] for row, (start, end) in spans if start <= now]

    def records(self, start: int = 0) -> Records:
        """The rows from one on, as they are kept; not a copy."""
        return self._rows[start : self._count]

    def head(self) -> list[Records]:
        """What ``run.part`` begins with: names and meta as JSON, and the table of holds."""
        joints, arms, hands = self._names
        text = {"format": FORMAT, "joints": joints, "arms": arms, "hands": hands, "meta": self._meta}
        holds = np.zeros(len(self._structure), [("hold_id", f"U{max(map(len, self._structure.ids))}"), *_HOLD])
        for name, values in self._holds().items():
            holds[name] = values
        return [np.array(json.dumps(text)), holds, self.presence()]

    def presence(self) -> Records:
        """When each hold was there, as ``run.part`` has it."""
        return np.array([(int(row), (start, end)) for row, start, end in self._spans], PRESENCE)

    def _grow(self, count: int) -> None:
        """Arrays that are full double."""
        while self._count + count > len(self._rows):
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)])

    def _holds(self) -> dict[str, Any]:
        """The table of holds, as the log has it."""
        holds = self._structure.holds
        return {
            "hold_id": self._structure.ids,
            "hold_pose": np.array([pin.SE3ToXYZQUAT(hold.pose) for hold in holds]),
            "hold_roll": np.array([ROLLS.get(hold.roll, hold.roll) for hold in holds]),
            "hold_max_tilt": self._structure.tilts,
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
        rows, presence = self._rows[: self._count], self.presence()
        names = dict(zip(("joints", "arms", "hands"), self._names, strict=True))
        fields: dict[str, Any] = {**names, **{name: rows[name].copy() for name in ROW}, **self._holds()}
        fields |= {name: presence[name] for name in ("presence_hold", "presence_span")}
        return WalkLog(**fields, meta=self._meta)

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
    out = {"wbc": __version__}
    for name in PACKAGES:
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "unknown"
    return out
