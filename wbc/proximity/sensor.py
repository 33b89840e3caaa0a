"""The sensor of the closest pairs: what sensed rows of a constraint are fed with before every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from wbc.errors import RangeError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.proximity.body import OBSTACLE, Body, checked_pairs
from wbc.proximity.choice import Choice
from wbc.proximity.corners import NEAR, Corners
from wbc.proximity.scene import Scene
from wbc.shapes import FAR
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


class PairSensor:
    """Writes the ``count`` closest of some pairs into the inputs of sensed rows.

    See :meth:`wbc.tasks.base.Constraint.sensed_rows` for what ``distance``, ``drift``, ``line`` and ``side`` mean. The
    first ``count`` rows are for the nearest points; then come ``corners`` rows a pair, see
    :mod:`wbc.proximity.corners`.

    Args:
        robot: the robot that carries the bodies.
        pairs: bodies A and B each; normals point from A to B.
        count: how many pairs have rows.
        numbers: views that are written (``distance``, ``drift``, ``line``, ``side``) and read (``pose``, and
            ``velocity`` where given, of what moves from outside; ``margin`` where given, [m]).
        moving: one more name, besides ``"obstacle"``, for the frame that moves with ``numbers["pose"]``.
        corners: how many more rows a pair has.

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
        corners: int = 0,
    ) -> None:
        outside = frozenset({OBSTACLE} if moving is None else {OBSTACLE, moving})
        checked = checked_pairs("pairs", robot, pairs, outside)
        if not checked:
            raise RangeError("pairs", 0, "expected a pair at least")
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise RangeError("count", count, "expected an integer >= 1")
        if isinstance(corners, bool) or not isinstance(corners, int) or corners < 0:
            raise RangeError("corners", corners, "expected an integer >= 0")
        self._scene = Scene(robot, checked, outside)
        self._names = [(a.name, b.name) for a, b in checked]
        self._side = sides(robot, self._scene)
        self.count = count
        whole, nv = count * (1 + corners), robot.nv
        self._all = [_view(numbers, "distance", whole), _view(numbers, "drift", whole)]
        self._all += [_view(numbers, "line", 6 * whole), _view(numbers, "side", nv * whole)]
        self._distance, self._drift = self._all[0][:count], self._all[1][:count]
        self._line = self._all[2][: 6 * count].reshape(count, 6)
        self._row_side = self._all[3][: nv * count].reshape(count, nv)
        self._corners = Corners(self._scene, corners) if corners else None
        rest = zip(self._all, (1, 1, 6, nv), strict=True)
        self._more = [values[count * size :].reshape(count, corners, size) for values, size in rest]
        self._margin = numbers["margin"] if "margin" in numbers else np.zeros(1)
        self._pose = self._velocity = None
        if self._scene.has_outside:
            self._pose = _view(numbers, "pose", 12)
            self._velocity = _view(numbers, "velocity", 6) if "velocity" in numbers else None
        self._outward = np.array([(b.frame in outside) - (a.frame in outside) for a, b in checked], dtype=float)
        self._seen, self._bare = b"", True
        self._drifts, self._twist = False, np.zeros(6)
        self._choice = Choice(self._scene, count)
        rows = min(count, len(checked))
        self._rows, self._got = slice(rows), np.zeros((16, rows))
        self._left, self._right = self._got[4:10], self._got[10:16]
        self._plus, self._minus = self._got[4:7], self._got[7:10]
        self._got_from, self._got_to = self._got[0], self._distance[self._rows]
        self._line_from, self._line_to = self._got[1:7].T, self._line[self._rows]
        self.reset()

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Rows whose normal is a declared one because shapes lie inside each other, see :mod:`wbc.proximity.judge`."""
        out = np.zeros(self.count, dtype=bool)
        rows = self._choice.pairs >= 0
        out[rows] = self._scene.doubtful[self._choice.pairs[rows]]
        return out

    def reset(self) -> None:
        """Forget which pairs had which rows; until the next :meth:`sense` no row has a pair."""
        self._choice.reset()
        for values, empty in zip(self._all, (FAR, 0.0, 0.0, 0.0), strict=True):
            values[:] = empty
        self._bare = True

    def sense(self, q: Array) -> None:
        """Measure at a configuration [nq] and write the rows."""
        scene = self._scene
        if self._pose is not None and self._pose.tobytes() != self._seen:
            scene.move(pin.SE3(self._pose[:9].reshape(3, 3).T, self._pose[9:]))
            self._seen = self._pose.tobytes()
        scene.place(q)
        if self._choice.update():
            self._arrange()
        self._write()
        if self._corners is not None:
            self._write_corners(self._corners)

    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """(name of A, name of B, distance [m]) of the rows that have a pair, in the last call."""
        rows = zip(self._choice.pairs.tolist(), self._distance.tolist(), strict=True)
        return tuple((*self._names[k], d) for k, d in rows if k >= 0)

    def _arrange(self) -> None:
        """Rows whose pairs have changed: their sides, and where their results are."""
        results, pairs = self._scene.results, self._choice.pairs[self._rows]
        self._row_side[self._rows] = self._side[pairs]
        n, p = results.start[pairs], results.start[pairs] + results.place
        nx, ny, nz, px, py, pz = n, n + 1, n + 2, p, p + 1, p + 2
        # p x n is the difference of six products, which two blocks of six columns hold
        columns = (n + results.gap, nx, ny, nz, py, pz, px, pz, px, py, nz, nx, ny, ny, nz, nx)
        self._where = np.array(columns)
        self._pair_outward = self._outward[pairs]

    def _write(self) -> None:
        # Not "raise", with which numpy takes into a copy; all numbers are valid
        self._scene.results.numbers.take(self._where, out=self._got, mode="clip")
        np.multiply(self._left, self._right, out=self._left)
        np.subtract(self._plus, self._minus, out=self._plus)
        self._got_to[:] = self._got_from
        self._line_to[:] = self._line_from
        if self._pose is not None and self._velocity is not None:
            self._drifts = any(self._velocity.tolist())
            if self._drifts:
                self._twist = twist_at_origin(self._velocity, self._pose[9:])
                self._drift[self._rows] = self._line_to @ self._twist * self._pair_outward
            else:
                self._drift[:] = 0.0

    def _write_corners(self, corners: Corners) -> None:
        """Rows for the corners of the pairs that are near; all others are far."""
        distance, drift, line, side = self._more
        limit = self._margin.item() + NEAR * self._scene.robot.characteristic_length
        near = (self._got_to < limit).nonzero()[0]
        if not self._bare:
            distance[:], drift[:], line[:], side[:] = FAR, 0.0, 0.0, 0.0
        self._bare = not near.size
        if not near.size:
            return
        gaps, lines = corners.measure(self._choice.pairs[near])
        distance[near, :, 0], line[near], side[near] = gaps, lines, self._row_side[near, None]
        if self._drifts:
            drift[near, :, 0] = lines @ self._twist * self._pair_outward[near, None]


def twist_at_origin(velocity: Array, origin: Array) -> Array:
    """A twist (linear; angular) in world axes, taken from one point of the body to its point at the world's origin."""
    vx, vy, vz, wx, wy, wz = velocity.tolist()
    x, y, z = origin.tolist()
    return np.array([vx - wy * z + wz * y, vy - wz * x + wx * z, vz - wx * y + wy * x, wx, wy, wz])


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
