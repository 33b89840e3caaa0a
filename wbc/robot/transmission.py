"""Drives that move several joints each: a differential wrist, an elbow that a belt keeps parallel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array

#: Drives are refused where their matrix loses more than so many of a number's 16 digits
WORST_CONDITION = 1e12


@dataclass(frozen=True, eq=False)
class Transmission:
    """The constant linear map between n joints and n drives,

        d = C q + c,   dd/dt = C dq/dt,   tau_q = C' tau_d    (virtual work: tau_q . dq = tau_d . dd).

    Args:
        joints: their names, in the order of the columns of C.
        drives: drive name -> {joint: coefficient}, a row of C each, as many as joints.
        offset: c [rad or m], one a drive; default 0.

    Raises:
        UnknownNameError: a joint that is not in ``joints``. ShapeError: not as many drives as joints, numbers that are
            none. RangeError: C has no inverse, so that the drives do not say where the joints are.
    """

    joints: tuple[str, ...]
    drives: Mapping[str, Mapping[str, float]]
    offset: Sequence[float] | None = None
    zero: Array = field(init=False, repr=False)
    matrix: Array = field(init=False, repr=False)
    inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        joints, rows = validation.strings("joints", self.joints), validation.mapping("drives", self.drives)
        n = len(joints)
        if len(rows) != n or n == 0:
            raise ShapeError("drives", list(rows), f"expected as many drives as joints, {n}")
        matrix = np.zeros((n, n))
        for k, (name, row) in enumerate(rows.items()):
            for joint, coefficient in validation.mapping(f"drives.{name}", row, "joints to coefficients").items():
                column = joints.index(validation.one_of(f"drives.{name}", joint, joints))
                matrix[k, column] = validation.scalar(f"drives.{name}.{joint}", coefficient)
        condition = float(np.linalg.cond(matrix))
        if not condition < WORST_CONDITION:
            raise RangeError("drives", list(rows), f"the joints do not follow from the drives, condition {condition:g}")
        offset = validation.ordinary_array("offset", np.zeros(n) if self.offset is None else self.offset, (n,))
        for key, value in (("joints", joints), ("drives", rows), ("zero", offset), ("matrix", matrix)):
            object.__setattr__(self, key, value)
        object.__setattr__(self, "inverse", np.linalg.inv(matrix))

    def to_drives(self, q: Any) -> Array:
        """Positions of the drives [n]."""
        return np.asarray(self.matrix @ self._checked("q", q) + self.zero)

    def to_joints(self, d: Any) -> Array:
        """Positions of the joints [n]."""
        return np.asarray(self.inverse @ (self._checked("d", d) - self.zero))

    def drive_rates(self, v: Any) -> Array:
        """Rates of the drives for rates of the joints [n]."""
        return np.asarray(self.matrix @ self._checked("v", v))

    def joint_rates(self, w: Any) -> Array:
        """Rates of the joints for rates of the drives [n]."""
        return np.asarray(self.inverse @ self._checked("w", w))

    def joint_torques(self, torques: Any) -> Array:
        """Torques at the joints for torques of the drives [n]."""
        return np.asarray(self.matrix.T @ self._checked("torques", torques))

    def _checked(self, name: str, values: Any) -> Array:
        return validation.ordinary_array(name, values, (len(self.joints),))
