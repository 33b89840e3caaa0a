"""Motions of a tree: scalars as polynomials between knots, free poses that shift and turn evenly between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wbc import validation
from wbc.clearance.tree import Tree
from wbc.errors import ContinuityError, RangeError, ShapeError
from wbc.multibody import pin
from wbc.rotations import matrices
from wbc.validation import Array

#: Highest degree of the polynomials
DEGREE = 7
#: What rounding may leave between two of them, in parts of the greatest scalar
JUMP = 1e-12


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of a :class:`Tree` over k knots.

    Between two knots the scalar c is sum_i B_i(s) ``controls[., c, i]`` with Bernstein's polynomials of s = 0 .. 1; a
    free pose has p + s (p' - p) and R exp(s log(R^T R')).

    Attributes:
        times: of the knots [k], rising [s].
        controls: [k - 1, scalars, degree + 1], rad or m.
        poses: of the free joints [free, k, 12]: rotation row by row, then position [m].
        slack: how far the scalars may truly be off [scalars], rad or m; as a controller's deviation.
        free_slack: of the free poses [free, 2], m and rad.

    Raises:
        ShapeError, NotFiniteError: arrays of other shapes. RangeError: times that do not rise, slack below 0.
        RotationError: a pose that is none. ContinuityError: polynomials that do not meet at a knot.
    """

    times: Array
    controls: Array
    poses: Array
    slack: Array
    free_slack: Array

    def __post_init__(self) -> None:
        times = validation.real_array("Motion.times", self.times)
        if times.ndim != 1 or len(times) < 2:
            raise ShapeError("Motion.times", self.times, "expected at least two knots")
        if not (np.diff(times) > 0.0).all():
            k = int(np.argmin(np.diff(times)))
            raise RangeError(f"Motion.times[{k + 1}]", float(times[k + 1]), f"expected more than {float(times[k]):g} s")
        controls = validation.real_array("Motion.controls", self.controls)
        if controls.ndim != 3 or len(controls) != len(times) - 1 or not 2 <= controls.shape[2] <= DEGREE + 1:
            reason = f"expected {len(times) - 1} x scalars x 2 to {DEGREE + 1} coefficients"
            raise ShapeError("Motion.controls", np.shape(self.controls), reason)
        jumps = np.abs(controls[1:, :, 0] - controls[:-1, :, -1])
        if jumps.size and jumps.max() > JUMP * max(1.0, float(np.abs(controls).max())):
            k, c = (int(i) for i in np.unravel_index(int(jumps.argmax()), jumps.shape))
            raise ContinuityError(f"Motion.controls[{k + 1}, {c}]", float(jumps[k, c]), "the scalar jumps at this knot")
        poses = validation.real_array("Motion.poses", self.poses)
        if poses.ndim != 3 or poses.shape[1:] != (len(times), 12):
            raise ShapeError("Motion.poses", np.shape(self.poses), f"expected free joints x {len(times)} x 12")
        turns = poses[:, :, :9].reshape(-1, 3, 3)
        if len(turns):
            off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
            validation.rotation("Motion.poses", turns[int(off.argmax())])
        wanted = {"slack": (controls.shape[1],), "free_slack": (len(poses), 2)}
        for name, shape in wanted.items():
            slack = validation.real_array(f"Motion.{name}", getattr(self, name), shape)
            if (slack < 0.0).any():
                raise RangeError(f"Motion.{name}", float(slack.min()), "expected at least 0")
            object.__setattr__(self, name, slack)
        for name, array in (("times", times), ("controls", controls), ("poses", poses)):
            object.__setattr__(self, name, np.ascontiguousarray(array))

    @classmethod
    def linear(
        cls, tree: Tree, times: Any, q: Any, poses: Any = None, *, slack: Any = 0.0, free_slack: Any = 0.0
    ) -> Motion:
        """Scalars that change evenly from knot to knot.

        Args:
            q: [k, scalars] in the order of ``tree.coordinates``. poses: of the one free joint, [k, 7] (position and
                quaternion x, y, z, w), or of each, [free, k, 7]; None where there is none.
            slack, free_slack: as the attributes; numbers count for all.
        """
        at = _coordinates(tree, times, "q", q)
        return cls._of(tree, times, np.stack([at[:-1], at[1:]], axis=2), poses, slack, free_slack)

    @classmethod
    def cubic(
        cls, tree: Tree, times: Any, q: Any, v: Any, poses: Any = None, *, slack: Any = 0.0, free_slack: Any = 0.0
    ) -> Motion:
        """Scalars with these rates ``v`` [k, scalars] at the knots, cubic between them; else as :meth:`linear`."""
        at, rate = _coordinates(tree, times, "q", q), _coordinates(tree, times, "v", v)
        third = np.diff(validation.real_array("times", times))[:, None] / 3.0
        parts = [at[:-1], at[:-1] + third * rate[:-1], at[1:] - third * rate[1:], at[1:]]
        return cls._of(tree, times, np.stack(parts, axis=2), poses, slack, free_slack)

    @classmethod
    def polynomial(cls, tree: Tree, times: Any, controls: Array) -> Motion:
        """Scalars with these Bernstein coefficients [k - 1, scalars, degree + 1] of polynomials that meet at the knots
        but for rounding; of a tree without free joints.
        """
        controls = np.repeat(controls, 3 - min(controls.shape[2], 2), axis=2)
        controls[1:, :, 0] = controls[:-1, :, -1]
        return cls._of(tree, times, controls, None, 0.0, 0.0)

    @classmethod
    def _of(cls, tree: Tree, times: Any, controls: Array, poses: Any, slack: Any, free_slack: Any) -> Motion:
        count = len(tree.free)
        given = np.zeros((0, len(controls) + 1, 7)) if poses is None else validation.real_array("poses", poses)
        given = given[None] if given.ndim == 2 else given
        if given.shape != (count, len(controls) + 1, 7):
            raise ShapeError("poses", given.shape, f"expected {count} x {len(controls) + 1} x 7")
        return cls(
            times,
            controls,
            np.concatenate(
                [quaternion_matrices(given[:, :, 3:]).reshape(*given.shape[:2], 9), given[:, :, :3]], axis=2
            ),
            _for_all("slack", slack, (controls.shape[1],)),
            _for_all("free_slack", free_slack, (count, 2)),
        )

    @property
    def degree(self) -> int:
        """Of the polynomials."""
        return int(self.controls.shape[2]) - 1

    @cached_property
    def rates(self) -> Array:
        """No less than any |dq/ds| between two knots, [k - 1, scalars]: the greatest step of the coefficients."""
        return np.ascontiguousarray(self.degree * np.abs(np.diff(self.controls, axis=2)).max(axis=2))

    @cached_property
    def variation(self) -> Array:
        """No less than the way of every scalar from the first knot on, [k, scalars]: the coefficients' way."""
        return np.asarray(_summed(np.abs(np.diff(self.controls, axis=2)).sum(axis=2)[None])[0])

    @cached_property
    def turns(self) -> Array:
        """Turn from every knot to the next, in the axes of the frame there, [free, k - 1, 3] rad."""
        rotation = self.poses[:, :, :9].reshape(*self.poses.shape[:2], 3, 3)
        relative = rotation[:, :-1].transpose(0, 1, 3, 2) @ rotation[:, 1:]
        sine = np.stack([relative[..., (k + 2) % 3, (k + 1) % 3] for k in range(3)], axis=-1)
        sine -= np.stack([relative[..., (k + 1) % 3, (k + 2) % 3] for k in range(3)], axis=-1)
        length, cosine = np.linalg.norm(sine, axis=-1), np.trace(relative, axis1=-2, axis2=-1) - 1.0
        angle = np.arctan2(length, cosine)
        out = sine * np.divide(angle, length, out=np.full_like(angle, 0.5), where=length > 1e-9)[..., None]
        # Towards half a turn the sine says nothing of the axis
        for f, k in np.argwhere(cosine < -1.9).tolist():
            out[f, k] = pin.log3(relative[f, k])
        return np.ascontiguousarray(out)

    @cached_property
    def free_variation(self) -> Array:
        """Way [m] and angle [rad] of every free pose from the first knot on, [free, k, 2]."""
        shifts = np.linalg.norm(np.diff(self.poses[:, :, 9:], axis=1), axis=2)
        return _summed(np.stack([shifts, np.linalg.norm(self.turns, axis=2)], axis=2))

    def knots(self, time: float) -> float:
        """A time as a number of knots, fractions between them."""
        return float(np.interp(time, self.times, np.arange(len(self.times))))

    def time(self, knots: float) -> float:
        """The time of a number of knots [s]."""
        return float(np.interp(knots, np.arange(len(self.times)), self.times))


def quaternion_matrices(x: Array) -> Array:
    """Rotations ``[..., 3, 3]`` of quaternions (x, y, z, w), brought to norm 1; RotationError where that is far off."""
    length = np.linalg.norm(x, axis=-1, keepdims=True)
    if x.size and np.abs(length - 1.0).max() > validation.ROTATION_TOLERANCE:
        validation.rotation("poses", np.eye(3) * float(length.flat[int(np.abs(length - 1.0).argmax())]))
    return matrices(x / np.where(length > 0.0, length, 1.0))


def _for_all(field: str, value: Any, shape: tuple[int, ...]) -> Array:
    """A number counts for all."""
    array = validation.real_array(field, value)
    return np.full(shape, array) if array.ndim == 0 else array


def _coordinates(tree: Tree, times: Any, field: str, value: Any) -> Array:
    wanted = (len(validation.real_array("times", times)), len(tree.coordinates))
    return validation.real_array(field, value, wanted)


def _summed(steps: Array) -> Array:
    """Sums along the second axis, from 0 on."""
    return np.ascontiguousarray(np.concatenate([np.zeros_like(steps[:, :1]), np.cumsum(steps, axis=1)], axis=1))
