"""Values of declarations as plain data, exact and the same in every process."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from wbc.errors import ShapeError
from wbc.robot import Robot


def plain(value: Any, robot: Robot) -> Any:
    """A field's value as plain data; items within items by their own declarations.

    Raises:
        ShapeError: nothing that its data distinguish from another.
    """
    if hasattr(value, "declaration"):
        return value.declaration(robot)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {"class": type(value).__qualname__} | {
            f.name: plain(getattr(value, f.name), robot) for f in dataclasses.fields(value)
        }
    if isinstance(value, (list, tuple)):
        return [plain(v, robot) for v in value]
    if isinstance(value, Mapping):
        return {str(k): plain(v, robot) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return [float(v).hex() for v in value.ravel()] + list(value.shape)
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "homogeneous"):
        return plain(np.asarray(value.homogeneous), robot)
    if isinstance(value, (str, int, bool, type(None))):
        return value
    if isinstance(value, float):
        return value.hex()
    if isinstance(value, ca.Function):
        return value.serialize()
    raise ShapeError("declaration", value, "only plain data, arrays, poses and CasADi functions")
