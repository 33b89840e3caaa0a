"""Bilateral teleoperation over links with delay. See docs/teleoperation.md."""

from __future__ import annotations

from wbc.teleop.bilateral.run import (
    BilateralRecord as BilateralRecord,
    Operator as Operator,
    Packet as Packet,
    Port as Port,
    Wall as Wall,
    run_bilateral as run_bilateral,
)
from wbc.teleop.bilateral.scheme import (
    Bilateral as Bilateral,
    Channel as Channel,
    Channels as Channels,
    Device as Device,
    Scheme as Scheme,
    four_channel as four_channel,
    position_force as position_force,
    position_position as position_position,
)
