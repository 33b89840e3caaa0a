"""The sensor of the closest pairs: what sensed rows of a constraint are fed with before every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from wbc.errors import RangeError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.proximity.body import OBSTACLE, Body, checked_pairs
from wbc.proximity.scene import Scene
from wbc.shapes import FAR
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot

#: More pairs than this are refused.
MAX_PAIRS = 20_000

#: A pair keeps its row until another one is closer by this share of its distance ...
KEEP_SHARE = 0.1
#: ... and by this share of the robot's characteristic length.
KEEP_LENGTH = 0.005


class PairSensor:
    """Writes the ``count`` closest of some pairs into the inputs of sensed rows.

    See :meth:`wbc.tasks.base.Constraint.sensed_rows` for what ``distance``, ``drift``, ``line`` and ``side`` mean.

    Args:
        robot: the robot that carries the bodies.
        pairs: bodies A and B each; normals point from A to B.
        count: how many rows there are.
        numbers: views that are written (``distance``, ``drift``, ``line``, ``side``) and read (``pose``, and
            ``velocity`` where given, of what moves from outside).
        moving: one more name, besides ``"obstacle"``, for the frame that moves with ``numbers["pose"]``.

    Raises:
        ShapeError, RangeError, UnknownNameError, DuplicateNameError: no pairs, too many, or bad ones.
        UnsupportedJointError: a pair that a mimic joint and its leader move in different ways.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: Sequence[tuple[Body, Body]],
        count: int,
        numbers: Mapping[str, Array],
        *,
        moving: str | None = None,
    ) -> None:
        outside = frozenset({OBSTACLE} if moving is None else {OBSTACLE, moving})
        checked = checked_pairs("pairs", robot, pairs, outside)
        if not 1 <= len(checked) <= MAX_PAIRS:
            raise RangeError("pairs", len(checked), f"expected 1 to {MAX_PAIRS} pairs")
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise RangeError("count", count, "expected an integer >= 1")
        self._scene = Scene(robot, checked, outside)
        self._names = [(a.name, b.name) for a, b in checked]
        self._side = sides(robot, self._scene)
        self.count = count
        self._distance, self._drift = _view(numbers, "distance", count), _view(numbers, "drift", count)
        self._line = _view(numbers, "line", 6 * count).reshape(count, 6)
        self._rows_side = _view(numbers, "side", robot.nv * count).reshape(count, robot.nv)
        self._pose = self._velocity = None
        if self._scene.outside:
            self._pose = _view(numbers, "pose", 12)
            self._velocity = _view(numbers, "velocity", 6) if "velocity" in numbers else None
        self._outward = np.array([(b.frame in outside) - (a.frame in outside) for a, b in checked], dtype=float)
        self._slack = KEEP_LENGTH * robot.characteristic_length
        self.reset()

    def reset(self) -> None:
        """Forget which pairs had which rows; until the next :meth:`sense` no row has a pair."""
        self._chosen = np.full(self.count, -1, dtype=np.intp)
        self._distance[:], self._drift[:], self._line[:], self._rows_side[:] = FAR, 0.0, 0.0, 0.0

    def sense(self, q: Array) -> None:
        """Measure at a configuration [nq] and write the rows."""
        if self._pose is not None:
            self._scene.move(pin.SE3(self._pose[:9].reshape(3, 3).T, self._pose[9:]))
        distance, normal, point = self._scene.measure(q)
        self._choose(distance)
        rows = np.flatnonzero(self._chosen >= 0)
        pair = self._chosen[rows]
        self._distance[:], self._drift[:], self._line[:], self._rows_side[:] = FAR, 0.0, 0.0, 0.0
        self._distance[rows] = distance[pair]
        self._line[rows, :3] = normal[pair]
        self._line[rows, 3:] = np.cross(point[pair], normal[pair])
        self._rows_side[rows] = self._side[pair]
        if self._pose is not None and self._velocity is not None:
            at = self._velocity[:3] + np.cross(self._velocity[3:], point[pair] - self._pose[9:])
            self._drift[rows] = self._outward[pair] * np.einsum("ij,ij->i", normal[pair], at)

    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """(name of A, name of B, distance [m]) of the rows that have a pair, in the last call."""
        rows = [(int(k), float(d)) for k, d in zip(self._chosen, self._distance, strict=True) if k >= 0]
        return tuple((*self._names[k], d) for k, d in rows)

    def _choose(self, distance: Array) -> None:
        score = distance.copy()
        kept = self._chosen[self._chosen >= 0]
        score[kept] -= KEEP_SHARE * np.maximum(distance[kept], 0.0) + self._slack
        best = np.argsort(score, kind="stable")[: self.count]
        self._chosen[~np.isin(self._chosen, best)] = -1
        fresh = best[~np.isin(best, self._chosen)]
        self._chosen[np.flatnonzero(self._chosen < 0)[: len(fresh)]] = fresh


def sides(robot: Robot, scene: Scene) -> Array:
    """Pairs x nv: 1 for degrees of freedom that move B only, -1 for A only, 0 for both and for none.

    Raises:
        UnsupportedJointError: one number of v turns a joint that moves a body and a mimic joint that does not.
        RangeError: a pair that no joint moves relative to each other.
    """
    model = robot.model
    carried = np.zeros((len(scene.bodies), model.njoints))
    for k, joint in enumerate(scene.joints):
        carried[k, [j for j in list(model.supports[joint]) if j > 0]] = 1.0
    by_joint = carried[scene.second] - carried[scene.first]
    leader = {int(f): int(k) for f, k in zip(model.mimicking_joints, model.mimicked_joints, strict=True)}
    out = np.zeros((len(by_joint), robot.nv))
    for j in range(1, model.njoints):
        if j not in leader:
            out[:, int(model.idx_vs[j]) : int(model.idx_vs[j]) + int(model.nvs[j])] = by_joint[:, j, None]
        elif not np.array_equal(by_joint[:, j], by_joint[:, leader[j]]):
            k = int(np.argmax(by_joint[:, j] != by_joint[:, leader[j]]))
            a, b = scene.bodies[scene.first[k]], scene.bodies[scene.second[k]]
            reason = f"the mimic joint {model.names[j]!r} and its leader do not move the same bodies of this pair"
            raise UnsupportedJointError(f"pairs[{k}]", (a.name, b.name), reason)
    still = np.flatnonzero(~out.any(axis=1))
    if len(still):
        a, b = scene.bodies[scene.first[still[0]]], scene.bodies[scene.second[still[0]]]
        raise RangeError(f"pairs[{still[0]}]", (a.name, b.name), "no joint moves these bodies relative to each other")
    return out


def _view(numbers: Mapping[str, Array], name: str, size: int) -> Array:
    if name not in numbers:
        raise UnknownNameError("numbers", name, list(numbers))
    view = numbers[name]
    if view.shape != (size,):
        raise ShapeError(f"numbers[{name!r}]", view.shape, f"expected {size} numbers")
    return view
