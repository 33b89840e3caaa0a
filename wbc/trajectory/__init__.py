"""Laws of motion: paths, timings, and certificates of the limits that they keep.

Names are imported when they are first used, so that toppra and ruckig cost nothing until then.
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

#: Public name -> module that defines it
_WHERE = {
    "Law": "law",
    "State": "law",
    "Limits": "limits",
    "LawCertificate": "certificate",
    "Worst": "certificate",
    "Path": "path",
    "PolynomialPath": "path",
    "Timing": "timing",
    "follow": "following",
    "Followed": "following",
    "time_optimal": "least_time",
    "jerk_limited": "between_states",
    "jerk_limited_along": "along",
    "online": "online_filter",
    "Online": "online_filter",
    "standing_path": "joint_paths",
    "straight_path": "joint_paths",
    "spline_path": "joint_paths",
    "blend_path": "joint_paths",
    "FunctionPath": "from_function",
    "function_path": "from_function",
    "PosePath": "pose_path",
    "geodesic_path": "pose_paths",
    "pose_polyline": "pose_paths",
    "pose_spline": "pose_paths",
    "arc_path": "arcs",
    "arc_through": "arcs",
    "via_points": "via_poses",
    "load": "files",
    "plot": "plots",
}

__all__ = sorted(_WHERE)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name == "Certificate":
        warnings.warn("Certificate is called LawCertificate now", DeprecationWarning, stacklevel=2)
        name = "LawCertificate"
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_WHERE[name]}"), name)


def __dir__() -> list[str]:
    return sorted(_WHERE)
