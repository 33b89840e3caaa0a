"""Paths of a body as plain data, for logs and files of plans."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.walking.body_path import BodyPath
from wbc.walking.log.log import WalkLogError


def way_of(path: BodyPath) -> dict[str, Any]:
    """A body's path as plain data: its spacing [s] and its poses, each with position and quaternion."""
    poses = [pin.SE3ToXYZQUAT(pin.SE3(pose)).tolist() for pose in path.poses]
    return {"spacing": path.spacing, "poses": poses}


def path_of(way: Any) -> BodyPath:
    """The path of :func:`way_of`.

    Raises:
        WalkLogError: it is none.
    """
    try:
        rows = np.asarray(way["poses"], dtype=float).reshape(-1, 7)
        return BodyPath(np.array([pin.XYZQUATToSE3(row).homogeneous for row in rows]), way["spacing"])
    except (KeyError, TypeError, ValueError, WbcError) as error:
        raise WalkLogError("way", type(way).__name__, f"no path of a body: {error}") from error
