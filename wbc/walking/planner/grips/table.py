"""Grips: one hand on one hold with one wrist branch, over the samples of a body path at which that is possible."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Margins, Walker
from wbc.validation import Array
from wbc.walking.arms.puma import LIMIT_NAMES, limb_of
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.planner.around import NONE_MET, Around, around
from wbc.walking.planner.grips.held import Held, held, near_holds
from wbc.walking.planner.grips.rolls import ANY, turns
from wbc.walking.planner.grips.stretches import stretches
from wbc.walking.planner.slices import Slices, drained

Ints = NDArray[np.int64]
#: Hands that hold: (arm, hold), their rows, -> a sample of the path and the angle of the last joint there [rad]
Holding = Mapping[tuple[int, int], tuple[int, float]]
NONE_HOLD: Holding = {}

#: Reason of a grip that lasts as long as the path
END = "end of the path"
#: Reasons of grips that end as a joint would have to turn too fast end with this
RATE = " rate"
#: Postures of a slice
ROWS = 12000
#: A grip of fewer samples is none
SHORTEST = 3


def reasons_of(limit_names: Sequence[str], joints: int, met: Sequence[str] = ()) -> tuple[str, ...]:
    """What may end a grip of a limb; ``met``: names of what may be in its way."""
    ways = (f"{name} is in the way" for name in met)
    return (*limit_names, "reach", *(f"joint {k}{RATE}" for k in range(1, joints + 1)), END, *ways)


@dataclass(frozen=True, eq=False)
class Grips:
    """All grips over a body path; grip g is of ``arm[g]`` on ``hold[g]`` (its row in the structure).

    Attributes:
        arm, hold, branch: ``[grips]``; hold -1 is gone; branch 0 is theta5 >= 0, 1 is theta5 < 0.
        first, last: samples of the path, both included, ``[grips]``.
        offset: grip g's postures are ``postures[offset[g] : offset[g] + last[g] - first[g] + 1]``.
        postures: ``[all samples, joints]`` [rad]; the last joint is 0 where the roll is free.
        ends: why each ends: an index into :attr:`reasons`.
        roll: ``[grips]``, number of the hold's allowed rolls; -1 where it is free.
        reasons: what may end a grip.
    """

    arm: Ints
    hold: Ints
    branch: Ints
    first: Ints
    last: Ints
    offset: Ints
    postures: Array
    ends: Ints
    roll: Ints
    reasons: tuple[str, ...] = reasons_of(LIMIT_NAMES, 6)
    _ends: dict[float, list[float]] = field(default_factory=dict, init=False, repr=False)
    _wrists: dict[int, tuple[int, int, Array]] = field(default_factory=dict, init=False, repr=False)

    def __len__(self) -> int:
        return len(self.arm)

    @property
    def table(self) -> compiled.Table:
        """As the compiled code wants them; they must live as long."""
        return compiled.Table(*(array.ctypes.data for array in (self.postures, self.offset, self.first, self.last)))

    def posture(self, grip: Ints, sample: Ints) -> Array:
        """Postures at samples, clipped to the grip, ``[..., 6]``."""
        first = self.first[grip]
        inside = np.minimum(np.maximum(sample - first, 0), self.last[grip] - first)
        out: Array = self.postures[self.offset[grip] + inside]
        return out

    def posture_at(self, grip: int, sample: int) -> Array:
        """Of one grip at one sample, clipped to the grip ``[6]``."""
        first = int(self.first[grip])
        out: Array = self.postures[int(self.offset[grip]) + min(max(sample, first), int(self.last[grip])) - first]
        return out

    def wrist_at(self, grip: int, sample: float) -> tuple[float, float, float]:
        """Joints 4 to 6 of one grip at a fractional sample, by straight lines, clipped to the grip [rad]."""
        first, last, rows = self.wrists(grip)
        inside = min(max(sample, first), last) - first
        low = min(int(inside), last - first - 1)
        ((a, b, c), (d, e, f)), part = rows[low : low + 2].tolist(), inside - low
        return a + part * (d - a), b + part * (e - b), c + part * (f - c)

    def wrists(self, grip: int) -> tuple[int, int, Array]:
        """First and last sample of one grip, and joints 4 to 6 from the one to the other ``[samples, 3]`` [rad]."""
        known = self._wrists.get(grip)
        if known is None:
            first, last, offset = int(self.first[grip]), int(self.last[grip]), int(self.offset[grip])
            rows = self.postures[offset : offset + last - first + 1, 3:].copy()
            known = self._wrists[grip] = first, last, rows
        return known

    def ends_at(self, spacing: float) -> list[float]:
        """Path times of the last samples of all grips [s], of a path with this spacing; the list is cached."""
        if spacing not in self._ends:
            self._ends[spacing] = (self.last * spacing).tolist()
        return self._ends[spacing]

    def between(self, grip: Ints, samples: Array) -> Array:
        """Postures at fractional samples, by straight lines, clipped to the grip, ``[..., 6]``."""
        inside = np.clip(samples - self.first[grip], 0.0, self.last[grip] - self.first[grip])
        low = np.minimum(inside.astype(np.int64), np.maximum(self.last[grip] - self.first[grip] - 1, 0))
        row = self.offset[grip] + low
        first = self.postures[row]
        out: Array = first + (inside - low)[..., None] * (self.postures[row + 1] - first)
        return out

    def first_where(self, flags: NDArray[np.bool_]) -> Ints:
        """First samples at which flags of :attr:`postures` hold ``[grips]``; one behind the end for none."""
        there = np.append(flags, True)
        following = np.minimum.accumulate(np.where(there, np.arange(len(there)), len(there))[::-1])[::-1]
        out: Ints = np.minimum(following[self.offset] - self.offset + self.first, self.last + 1)
        return out

    def of_arm(self, arm: int) -> Ints:
        """Grips of an arm, on holds that are there."""
        return np.nonzero((self.arm == arm) & (self.hold >= 0))[0]

    def renumbered(self, rows: Ints) -> Grips:
        """The same grips when hold k has become row ``rows[k]`` of another structure, -1 where it is gone."""
        return replace(self, hold=np.where(self.hold >= 0, rows[self.hold], -1))


def find_grips(walker: Walker, structure: Structure, path: BodyPath) -> Grips:
    """Every grip over a path: in reach, all joints within their limits less a margin, and slow enough from sample to
    sample at the commanded speed.
    """
    return drained(grip_slices(walker, structure, path))


def grip_slices(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    only: Sequence[int] = (),
    holding: Holding = NONE_HOLD,
) -> Slices[Grips]:
    """As :func:`find_grips`, in slices of about :data:`ROWS` postures.

    Args:
        only: one row of a hold for each arm, where others do not matter. holding: hands that hold where the roll is
            fixed: the grip at their roll is in the table, whichever would do for longer.
    """
    limb, margins, there = limb_of(walker), walker.margins, around(walker, structure)
    blocked = there.bodies(path.poses)
    size, found = max(ROWS // len(path), 1), list[tuple[int, int, int, int, int, int, int, Array]]()
    for arm in range(len(walker.arms)):
        frames = path.poses @ walker.arms[arm].base.homogeneous
        holds = np.array(only[arm : arm + 1], dtype=np.int64) if only else near_holds(limb, structure, frames)
        for begin in range(0, len(holds), size):
            some = holds[begin : begin + size]
            quick = stretches(there, arm, frames, blocked, some, path.spacing, margins, SHORTEST)
            if quick is None:
                found += _of_arm(there, margins, arm, frames, blocked, some, path.spacing, holding)
            else:
                found += [(arm, *stretch[:-1], ANY, stretch[-1]) for stretch in quick]
            yield None
    found.sort(key=lambda row: (row[0], row[2], row[1], row[3]))
    columns = list(zip(*found, strict=True)) if found else [()] * 8
    joints = len(limb.position_limits)
    postures = np.concatenate(columns[7]) if found else np.zeros((0, joints))
    lengths = np.array([len(rows) for rows in columns[7]], dtype=int)
    offset = np.concatenate([[0], np.cumsum(lengths)[:-1]]) if found else np.zeros(0)
    arms, rows, branch, first, last, ends, rolls = (np.array(column, dtype=np.int64) for column in columns[:7])
    reasons = reasons_of(limb.limit_names, joints, there.names)
    return Grips(arms, rows, branch, first, last, offset.astype(np.int64), postures, ends, rolls, reasons)


def _of_arm(
    around_it: Around,
    margins: Margins,
    arm: int,
    frames: Array,
    blocked: Ints,
    among: Ints,
    spacing: float,
    holding: Holding,
) -> Iterator[tuple[int, int, int, int, int, int, int, Array]]:
    """(arm, hold, branch, first, last, reason of the end, roll, postures) of every grip of an arm on some holds."""
    limb, structure = around_it.limb, around_it.structure
    lean_for = margins.lean_from * margins.held_reach
    there = held(limb, structure, frames, among, reach=margins.held_reach, facing=margins.facing, lean_for=lean_for)
    holds, samples, good, count = there.hold, there.pose, there.within(margins.held_angle), len(frames)
    if not len(samples):
        return
    most = margins.held_rate * spacing * np.array(limb.joint_rates)
    free, names = len(most) - 1, len(limb.limit_names)
    neighbours = (holds[1:] == holds[:-1]) & (samples[1:] == samples[:-1] + 1)
    for branch in range(there.q.shape[1]):
        q, fits = there.q[:, branch], good[:, branch].copy()
        meets = np.where(fits, blocked[samples], NONE_MET)
        some = np.nonzero(fits & (meets == NONE_MET))[0]
        meets[some] = around_it.postures(arm, frames[samples[some]], q[some], holds[some])
        fits &= meets == NONE_MET
        slow = [np.abs(q[1:, k] - q[:-1, k]) <= most[k] for k in range(free)]
        joined = np.logical_and.reduce([neighbours, fits[1:], fits[:-1], *slow])
        begins = np.nonzero(np.concatenate([[True], ~joined]))[0]
        ends = np.concatenate([begins[1:], [len(q)]]) - 1
        long = fits[begins] & (ends - begins + 1 >= SHORTEST)
        for begin, end in zip(begins[long].tolist(), ends[long].tolist(), strict=True):
            reason = _reason(there, branch, most[:free], neighbours, end, count, meets)
            first, last = int(samples[begin]), int(samples[end])
            hold, rows = int(holds[begin]), slice(begin, end + 1)
            if structure.free_rolls[hold]:
                yield arm, hold, branch, first, last, reason, ANY, q[rows]
                continue
            limit = limb.position_limits[free] - margins.held_angle
            here = holding.get((arm, hold))
            kept = None if here is None else (here[0] - first, here[1])
            for one in turns(q[rows][:, free], structure.holds[hold].rolls, limit, most[free], SHORTEST, kept):
                turned = q[rows][one.first : one.last + 1].copy()
                turned[:, free] = one.angles
                why = {"limit": free, "rate": names + 1 + free}.get(one.ends, reason)
                yield arm, hold, branch, first + one.first, first + one.last, why, one.roll, turned


def _reason(
    there: Held, branch: int, most: Array, neighbours: NDArray[np.bool_], end: int, count: int, meets: Ints
) -> int:
    """Why a grip ends after row ``end``: an index into ``Grips.reasons``."""
    q, names = there.q[:, branch], int(there.margins.shape[-1])
    if there.pose[end] == count - 1:
        return names + len(q[0]) + 1
    if end + 1 == len(q) or not neighbours[end]:
        return names
    if meets[end + 1] != NONE_MET:
        return names + len(q[0]) + 2 + int(meets[end + 1])
    used = np.abs(q[end + 1, : len(most)] - q[end, : len(most)]) / most
    if (used > 1.0).any():
        return names + 1 + int(np.argmax(used))
    return int(np.argmin(there.margins[end + 1, branch]))
