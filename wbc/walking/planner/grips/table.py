"""Grips: one hand on one hold with one wrist branch, over the samples of a body path at which that is possible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.arms.puma import LIMIT_NAMES, ArmKinematics
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.planner.grips.rolls import ANY, hand_poses, turns
from wbc.walking.planner.grips.stretches import Keeping, stretches
from wbc.walking.planner.grips.tilt import leaning
from wbc.walking.planner.slices import Slices, drained

Ints = NDArray[np.int64]

#: What the plan keeps of the limits for feedback: part of a rate, angle [rad] and reach [m]
RATE_PART, ANGLE_ROOM, REACH_ROOM = 0.85, radians(2.0), 0.3 * 0.0254
#: Postures of a slice, and how far samples may lie apart in the first look for holds in reach [m]
ROWS, LOOSE = 12000, 0.1
#: A grip of fewer samples is none
SHORTEST = 3
#: A hand leans on a compliant hold where the reach is less than this part of its room
LEAN_FROM = 1.25
#: The hand's approach and the body's z axis enclose less than 60 degrees: arms do not reach round the body
LEAST_FACING = 0.5
KEEPING = Keeping(RATE_PART, ANGLE_ROOM, REACH_ROOM, LEAST_FACING, SHORTEST, LEAN_FROM * REACH_ROOM)


@dataclass(frozen=True, eq=False)
class Grips:
    """All grips over a body path; grip g is of ``arm[g]`` on ``hold[g]`` (its row in the structure).

    Attributes:
        arm, hold, branch: ``[grips]``; hold -1 is gone; branch 0 is theta5 >= 0, 1 is theta5 < 0.
        first, last: samples of the path, both included, ``[grips]``.
        offset: grip g's postures are ``postures[offset[g] : offset[g] + last[g] - first[g] + 1]``.
        postures: ``[all samples, 6]`` [rad]; joint 6 is 0 where the roll is free.
        ends: why each ends: an index into :attr:`reasons`.
        roll: ``[grips]``, number of the hold's allowed rolls; -1 where it is free.
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
    _ends: dict[float, list[float]] = field(default_factory=dict, init=False, repr=False)
    _wrists: dict[int, tuple[int, int, Array]] = field(default_factory=dict, init=False, repr=False)

    #: What may end a grip
    reasons = (*LIMIT_NAMES, "reach", *(f"joint {k} rate" for k in range(1, 7)), "end of the path")

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
        """Path times of the last samples of all grips [s], of a path with this spacing; the list is kept."""
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

    def bent_from(self, angle: float) -> Ints:
        """First samples at which the elbows are bent by an angle [rad] ``[grips]``; one behind the end for none."""
        bent = np.append(self.postures[:, 2] <= -angle, True)
        following = np.minimum.accumulate(np.where(bent, np.arange(len(bent)), len(bent))[::-1])[::-1]
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


def grip_slices(walker: Walker, structure: Structure, path: BodyPath, only: Sequence[int] = ()) -> Slices[Grips]:
    """As :func:`find_grips`, in slices of about :data:`ROWS` postures.

    Args:
        only: one row of a hold for each arm, where others do not matter.
    """
    kinematics = ArmKinematics(walker.data)  # type: ignore[arg-type]
    size, found = max(ROWS // len(path), 1), list[tuple[int, int, int, int, int, int, int, Array]]()
    for arm in range(len(walker.arms)):
        frames = path.poses @ walker.arms[arm].base.homogeneous
        holds = np.array(only[arm : arm + 1], dtype=np.int64) if only else _near(kinematics, structure, frames)
        for begin in range(0, len(holds), size):
            some = holds[begin : begin + size]
            quick = stretches(kinematics, frames, structure, some, path.spacing, KEEPING)
            if quick is None:
                found += _of_arm(kinematics, arm, frames, structure, some, path.spacing)
            else:
                found += [(arm, *stretch[:-1], ANY, stretch[-1]) for stretch in quick]
            yield None
    found.sort(key=lambda row: (row[0], row[2], row[1], row[3]))
    columns = list(zip(*found, strict=True)) if found else [()] * 8
    postures = np.concatenate(columns[7]) if found else np.zeros((0, 6))
    lengths = np.array([len(rows) for rows in columns[7]], dtype=int)
    offset = np.concatenate([[0], np.cumsum(lengths)[:-1]]) if found else np.zeros(0)
    whole = [np.array(column, dtype=np.int64) for column in columns[:7]]
    arms, rows, branch, first, last, ends, rolls = whole
    return Grips(arms, rows, branch, first, last, offset.astype(np.int64), postures, ends, rolls)


def _near(kinematics: ArmKinematics, structure: Structure, frames: Array) -> Ints:
    """Rows of the holds that an arm may reach from some of its base's frames."""
    far = _length(kinematics) + LOOSE
    # From the neck, where the arm begins to move
    necks = frames[:, :3, 3] + frames[:, :3, 2] * kinematics.data.neck_length
    # Samples that are LOOSE apart stand for those between them
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(necks, axis=0), axis=1))])
    some = np.unique(np.searchsorted(way, np.arange(0.0, way[-1] + LOOSE, LOOSE), side="right") - 1)
    square = ((structure.positions[None] - necks[some, None]) ** 2).sum(axis=2).min(axis=0)
    return np.nonzero(square < far**2)[0]


def _length(kinematics: ArmKinematics) -> float:
    data = kinematics.data
    return data.shoulder_offset + data.upper_arm_length + data.forearm_length + data.hand_length


def _of_arm(
    kinematics: ArmKinematics, arm: int, frames: Array, structure: Structure, among: Ints, spacing: float
) -> Iterator[tuple[int, int, int, int, int, int, int, Array]]:
    """(arm, hold, branch, first, last, reason of the end, roll, postures) of every grip of an arm on some holds."""
    # In the arm's frame, hold by hold and sample by sample ``[holds, samples, 3]``
    turn, data, count = frames[:, :3, :3], kinematics.data, len(frames)
    flat = turn.transpose(1, 0, 2).reshape(3, -1)
    points = (structure.positions[among] @ flat).reshape(-1, count, 3)
    points -= np.einsum("nj,nji->ni", frames[:, :3, 3], turn)
    axes = (structure.axes[among] @ flat).reshape(-1, count, 3)
    x, y, z = points[..., 0], points[..., 1], points[..., 2] - data.neck_length
    near = (axes[..., 2] > LEAST_FACING) & (x * x + y * y + z * z < _length(kinematics) ** 2)
    points, axes, (holds, samples) = points[near], axes[near], np.nonzero(near)
    axes = leaning(kinematics, points, axes, structure.tilts[among[holds]], LEAN_FROM * REACH_ROOM)
    reached = kinematics.wrist_reach(kinematics.wrist_of(points, axes)) > REACH_ROOM
    points, axes, holds, samples = points[reached], axes[reached], among[holds[reached]], samples[reached]
    if not len(samples):
        return
    postures, solved = _postures(kinematics, structure, holds, points, axes, turn[samples])
    margins = kinematics.margins(postures)
    margins[..., 5] = np.inf  # joint 6 turns the hand about its own axis: free, or see rolls.py
    good = solved & np.logical_and.reduce([margins[..., k] > ANGLE_ROOM for k in range(margins.shape[-1])])
    most = RATE_PART * spacing * np.array(data.joint_rates)[:5]
    neighbours = (holds[1:] == holds[:-1]) & (samples[1:] == samples[:-1] + 1)
    for branch in range(postures.shape[1]):
        q, fits = postures[:, branch], good[:, branch]
        slow = [np.abs(q[1:, k] - q[:-1, k]) <= most[k] for k in range(5)]
        joined = np.logical_and.reduce([neighbours, fits[1:], fits[:-1], *slow])
        begins = np.nonzero(np.concatenate([[True], ~joined]))[0]
        ends = np.concatenate([begins[1:], [len(q)]]) - 1
        long = fits[begins] & (ends - begins + 1 >= SHORTEST)
        for begin, end in zip(begins[long].tolist(), ends[long].tolist(), strict=True):
            reason = _reason(samples, margins[:, branch], q, most, neighbours, end, count)
            first, last = int(samples[begin]), int(samples[end])
            hold, rows = int(holds[begin]), slice(begin, end + 1)
            if structure.free_rolls[hold]:
                yield arm, hold, branch, first, last, reason, ANY, q[rows]
                continue
            room, step = data.position_limits[5] - ANGLE_ROOM, RATE_PART * spacing * data.joint_rates[5]
            for one in turns(q[rows][:, 5], structure.holds[hold].rolls, room, step, SHORTEST):
                held = q[rows][one.first : one.last + 1].copy()
                held[:, 5] = one.angles
                why = {"limit": 5, "rate": len(LIMIT_NAMES) + 6}.get(one.ends, reason)
                yield arm, hold, branch, first + one.first, first + one.last, why, one.roll, held


def _postures(
    kinematics: ArmKinematics, structure: Structure, holds: Ints, points: Array, axes: Array, turn: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of both branches and whether they are possible; ``turn`` are rotations of the arm's base."""
    free = np.array(structure.free_rolls)[holds]
    if free.all():
        return kinematics.inverse_axis(points, axes)
    references = np.einsum("nji,nj->ni", turn, structure.references[holds])
    postures, solved = kinematics.inverse(hand_poses(points, axes, references))
    postures[free, :, 5] = 0.0
    return postures, solved


def _reason(samples: Ints, margins: Array, q: Array, most: Array, neighbours: Array, end: int, count: int) -> int:
    """Why a grip ends after row ``end``: an index into ``Grips.reasons``."""
    names = len(LIMIT_NAMES)
    if samples[end] == count - 1:
        return names + 7
    if end + 1 == len(samples) or not neighbours[end]:
        return names
    used = np.abs(q[end + 1, :5] - q[end, :5]) / most
    if (used > 1.0).any():
        return names + 1 + int(np.argmax(used))
    return int(np.argmin(margins[end + 1]))
