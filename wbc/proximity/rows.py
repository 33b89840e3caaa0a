"""Rows of the closest pairs: the buffers that a sensor writes, and what stays the same of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from wbc.errors import RangeError, ShapeError, UnknownNameError, UnsupportedJointError
from wbc.proximity.scene import PairScene
from wbc.shapes import FAR
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


@dataclass(frozen=True, eq=False)
class PairRows:
    """Views of the numbers of an item with sensed rows; one row a pair, then ``corners`` rows for each of them.

    Attributes:
        count: pairs with rows.
        distance, drift, line, side: what is written, ``count * (1 + corners)`` rows of 1, 1, 6 and nv numbers.
        pair_side: of every pair the row of ``side``.
        pose, velocity: of what moves from outside, where something does.
        margin: of the constraint [m]. rate: at which it may be used up [1/s]; infinite where none is given.
        most: of the margin that each pair keeps [m].
    """

    count: int
    corners: int
    distance: Array
    drift: Array
    line: Array
    side: Array
    pair_side: Array
    pose: Array | None
    velocity: Array | None
    margin: Array
    rate: Array
    most: Array

    @classmethod
    def of(
        cls, scene: PairScene, count: int, corners: int, numbers: Mapping[str, Array], most: Array | None = None
    ) -> PairRows:
        """Those of a scene.

        Raises:
            ShapeError, UnknownNameError: bad buffers. RangeError, UnsupportedJointError: as of :func:`sides`.
        """
        side, whole = sides(scene.robot, scene), count * (1 + corners)
        sizes = {"distance": whole, "drift": whole, "line": 6 * whole, "side": scene.robot.nv * whole}
        found = {name: _view(numbers, name, size) for name, size in sizes.items()}
        pose = velocity = None
        if scene.moving.any():
            pose = _view(numbers, "pose", 12)
            velocity = _view(numbers, "velocity", 6) if "velocity" in numbers else None
        margin = numbers["margin"] if "margin" in numbers else np.zeros(1)
        rate = numbers["rate"] if "rate" in numbers else np.full(1, np.inf)
        whole_margin = np.full(len(side), np.inf) if most is None else most
        return cls(
            count,
            corners,
            **found,
            pair_side=side,
            pose=pose,
            velocity=velocity,
            margin=margin,
            rate=rate,
            most=whole_margin,
        )

    def clear(self) -> None:
        """No row has a pair."""
        self.distance[:] = FAR
        for values in (self.drift, self.line, self.side):
            values[:] = 0.0


def _view(numbers: Mapping[str, Array], name: str, size: int) -> Array:
    if name not in numbers:
        raise UnknownNameError("numbers", name, list(numbers))
    view = numbers[name]
    if view.shape != (size,):
        raise ShapeError(f"numbers[{name!r}]", view.shape, f"expected {size} numbers")
    return view


def sides(robot: Robot, scene: PairScene) -> Array:
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
