"""Records a walk tick by tick."""

from __future__ import annotations

import functools
import itertools
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
from wbc.walking.log.log import WalkLog

#: Packages whose versions a log states, beside this one's
PACKAGES = ("numpy", "pin", "casadi", "daqp")
#: What ``WalkLog.hold_roll`` has for rolls that are no number
ROLLS: Mapping[Any, int] = {FREE: 0, FIXED: 1}
#: Numbers of a command -> its index in ``COMMANDS``
_KINDS = {0: 0, 6: 1, 7: 2}


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
        # One row a tick: t, pose, q, v, twist, command; and state, hold of every arm, kind of the command, fixed
        ends = np.cumsum([0, 1, 7, m, m, 6, 7])
        _, self._pose, self._q, self._v, self._twist, self._command = (
            slice(int(i), int(j)) for i, j in itertools.pairwise(ends)
        )
        self._reals, self._least = np.zeros((capacity, int(ends[-1]))), int(ends[-2])
        self._whole = np.zeros((capacity, 2 * a + 2), dtype=np.int64)
        self._arms, self._count, self._lengths = a, 0, (7, m, m, 6, a, a)
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
        # Rows are made of zeros, so what a command does not have is 0
        row = self._reals[k, : self._least + len(given)]
        np.concatenate(((t,), numbers, q, v, twist, given), out=row)
        self._whole[k] = (*states, *holds, _KINDS[len(given)], bool(body_fixed))
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
        rows = slice(self._count, self._count + n)
        np.concatenate((t[:, None], pose, q, v, twist, command), axis=1, out=self._reals[rows, : self._least + width])
        self._whole[rows] = np.column_stack((states, holds, np.full(n, _KINDS[width]), body_fixed))
        self._count += n

    def _grow(self, count: int) -> None:
        """Arrays that are full double."""
        while self._count + count > len(self._reals):
            self._reals = np.concatenate([self._reals, np.zeros_like(self._reals)])
            self._whole = np.concatenate([self._whole, np.zeros_like(self._whole)])

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
        n, a = self._count, self._arms
        reals, whole, holds = self._reals[:n], self._whole[:n], self._structure.holds
        return WalkLog(
            *self._names,
            t=reals[:, 0],
            pose_body_in_structure=reals[:, self._pose],
            q=reals[:, self._q],
            v=reals[:, self._v],
            twist_body=reals[:, self._twist],
            hand_state=whole[:, :a],
            hand_hold=whole[:, a : 2 * a],
            body_fixed=whole[:, 2 * a + 1].astype(bool),
            command=reals[:, self._command],
            command_kind=whole[:, 2 * a],
            hold_id=self._structure.ids,
            hold_pose=np.array([pin.SE3ToXYZQUAT(hold.pose) for hold in holds]),
            hold_roll=np.array([ROLLS.get(hold.roll, hold.roll) for hold in holds]),
            hold_max_tilt=self._structure.tilts,
            presence_hold=np.array([span[0] for span in self._spans], dtype=np.int64),
            presence_span=np.array([span[1:] for span in self._spans]),
            meta=self._meta,
        )

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
