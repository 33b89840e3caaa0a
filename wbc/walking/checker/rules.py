"""What a walk must keep, as numbers of the checker's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians

from wbc import validation
from wbc.errors import RangeError

INCH = 0.0254


@dataclass(frozen=True)
class Rules:
    """Limits in SI.

    Attributes:
        min_holds: fewest hands that hold; None: 2 for three arms and more, 1 for two.
        sub_samples: between ticks.
        hold_distance, hold_angle: of a closed hand from its hold, the angle beyond ``max_tilt`` or off its roll.
        body_distance, body_angle: of the logged body from the one that the holding hands give.
        close_speed, close_rate: of a hand that closes.
        position: of a joint beyond its limit. rate: of a joint beyond its limit, relative.
        rounding: by which a joint's steps may miss its logged rate times dt [rad].
        drift_distance, drift_angle: by which the offset of a closed hand may grow again.
        twist_speed, twist_rate: of the logged twist against the body's motion, means over ``twist_window``.
        asked_speed, asked_rate: by which the body may exceed what a path's request asks for, means over the same.
        acceleration: of a joint beyond its limit, relative. accelerations: limits by joint, which no URDF has
            [rad/s^2]; a joint without one is not checked.
        jump_speed, jump_rate: by which the body's velocity may change from tick to tick.
        clearance, clearance_slack: least distance, and by how much it may be missed.
        exempt_distance: a hand this near to a hold may touch what the hold stands on.
        exempt_depth: how deep it may be in that, beyond its roundness.
        latch_time: of closing and of opening, less a tick.
        observe: checks (their names) that are shown and do not count.

    Raises:
        ShapeError, NotFiniteError, RangeError: a field that is no number or below 0.
    """

    min_holds: int | None = None
    sub_samples: int = 10
    hold_distance: float = 0.002
    hold_angle: float = radians(0.5)
    body_distance: float = 0.002
    body_angle: float = radians(0.2)
    close_speed: float = 0.002
    close_rate: float = radians(0.5)
    position: float = 1e-6
    rate: float = 1e-6
    rounding: float = 1e-6
    drift_distance: float = 0.001
    drift_angle: float = radians(0.2)
    twist_speed: float = 0.01
    twist_rate: float = radians(1.0)
    twist_window: float = 0.1
    asked_speed: float = 0.01
    asked_rate: float = radians(1.0)
    acceleration: float = 0.01
    accelerations: Mapping[str, float] = field(default_factory=dict)
    jump_speed: float = 0.02
    jump_rate: float = 0.02
    clearance: float = 1.0 * INCH
    clearance_slack: float = 1e-4
    exempt_distance: float = 3.0 * INCH
    exempt_depth: float = 0.005
    latch_time: float = 0.1
    observe: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        limits = {
            joint: validation.scalar(f"Rules.accelerations[{joint!r}]", value, low=0.0, open_low=True, unit="rad/s^2")
            for joint, value in self.accelerations.items()
        }
        object.__setattr__(self, "accelerations", limits)
        object.__setattr__(self, "observe", tuple(validation.items("Rules.observe", self.observe, "names of checks")))
        for name, value in self.__dict__.items():
            if name in ("accelerations", "observe"):
                continue
            if name in ("min_holds", "sub_samples"):
                least = 1 if name == "sub_samples" else 0
                if value is None and name == "min_holds":
                    continue
                if isinstance(value, bool) or not isinstance(value, int) or value < least:
                    raise RangeError(f"Rules.{name}", value, f"expected a whole number of at least {least}")
            else:
                object.__setattr__(self, name, validation.scalar(f"Rules.{name}", value, low=0.0))

    def fewest(self, arms: int) -> int:
        """``min_holds`` of a machine with so many arms."""
        return (2 if arms > 2 else 1) if self.min_holds is None else self.min_holds
