"""Messages of ROS 2 as DDS carries them. The package reads the types of fields when a class is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int32, sequence, uint32


def _message(name: str, package: str, kind: str, /, **parts: Any) -> Any:
    """The class of ``PACKAGE/KIND``; a field is its type, or its type and what it is where it is not given."""
    types = {part: given[0] if isinstance(given, tuple) else given for part, given in parts.items()}
    empty: dict[str, Any] = {
        part: field(default_factory=given[1] if isinstance(given, tuple) else list) for part, given in parts.items()
    }
    body = {"__annotations__": types, "__module__": __name__, "__doc__": f"``{package}/{kind}``.", **empty}
    made = type(IdlStruct)(name, (IdlStruct,), body, typename=f"{package}::msg::dds_::{kind}_")
    return final(dataclass(made))


_NUMBERS = sequence[float64]
StampMessage = _message("StampMessage", "builtin_interfaces", "Time", sec=(int32, int), nanosec=(uint32, int))
SpanMessage = _message("SpanMessage", "builtin_interfaces", "Duration", sec=(int32, int), nanosec=(uint32, int))
HeaderMessage = _message("HeaderMessage", "std_msgs", "Header", stamp=(StampMessage, StampMessage), frame_id=(str, str))
JointStateMessage = _message(
    "JointStateMessage",
    "sensor_msgs",
    "JointState",
    header=(HeaderMessage, HeaderMessage),
    name=sequence[str],
    position=_NUMBERS,
    velocity=_NUMBERS,
    effort=_NUMBERS,
)
PointMessage = _message(
    "PointMessage",
    "trajectory_msgs",
    "JointTrajectoryPoint",
    positions=_NUMBERS,
    velocities=_NUMBERS,
    accelerations=_NUMBERS,
    effort=_NUMBERS,
    time_from_start=(SpanMessage, SpanMessage),
)
TrajectoryMessage = _message(
    "TrajectoryMessage",
    "trajectory_msgs",
    "JointTrajectory",
    header=(HeaderMessage, HeaderMessage),
    joint_names=sequence[str],
    points=sequence[PointMessage],
)
