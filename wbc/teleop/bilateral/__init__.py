"""Bilateral teleoperation over links with delay. See docs/teleoperation.md."""

from __future__ import annotations

from wbc.teleop.bilateral.run import BilateralRecord, Operator, Packet, Port, Wall, run_bilateral
from wbc.teleop.bilateral.scheme import (
    Bilateral,
    Channel,
    Channels,
    Device,
    Scheme,
    four_channel,
    position_force,
    position_position,
)

__all__ = [
    "Bilateral",
    "BilateralRecord",
    "Channel",
    "Channels",
    "Device",
    "Operator",
    "Packet",
    "Port",
    "Scheme",
    "Wall",
    "four_channel",
    "position_force",
    "position_position",
    "run_bilateral",
]
