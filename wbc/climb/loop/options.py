"""How the loop carries out a plan."""

from __future__ import annotations

from dataclasses import dataclass

from wbc import validation
from wbc.simulation import CommandKind

#: Periods of loops of velocities and of torques [s]
PERIODS = {CommandKind.VELOCITY: 0.01, CommandKind.TORQUE: 0.002}


@dataclass(frozen=True)
class LoopOptions:
    """What a loop does besides its plan.

    Attributes:
        period: of a tick [s]; None: 0.01 for velocities, 0.002 for torques.
        latch_distance: how far from its foothold a limb closes [m]; None: 1 mm by velocities, 3 mm by torques.
        latch_angle: how far its z axis, or the pose where that is fixed, may be turned then [rad].
        patience: how long the plan waits for a limb that is late [s].
        unload: time in which a limb hands over its load before it lifts, and takes it after it lands, of torques [s].
        bandwidth: omega of a = a_ref + 2 omega (v_ref - v) + omega^2 (q_ref - q), of torques [1/s].
        friction: share of the coefficients of friction, and of soles, on which torques count [1].
        delay: of the torques, which the loop knows [s].
        log: whether ticks are logged; without, the log has the start alone.
        press: speed at which a foot that is late goes on against its foothold's normal, of torques [m/s].

    Raises:
        ShapeError, NotFiniteError, RangeError: a field that is no such number.
    """

    period: float | None = None
    latch_distance: float | None = None
    latch_angle: float = 0.02
    patience: float = 1.0
    unload: float = 0.08
    bandwidth: float = 30.0
    friction: float = 0.75
    delay: float = 0.0
    press: float = 0.02
    log: bool = True

    def __post_init__(self) -> None:
        if self.latch_distance is not None:
            validation.scalar("LoopOptions.latch_distance", self.latch_distance, low=0.0, open_low=True, unit="m")
        for name in ("latch_angle", "patience", "bandwidth"):
            validation.scalar(f"LoopOptions.{name}", getattr(self, name), low=0.0, open_low=True)
        for name in ("unload", "delay", "press"):
            validation.scalar(f"LoopOptions.{name}", getattr(self, name), low=0.0)
        validation.scalar("LoopOptions.friction", self.friction, low=0.0, high=1.0, open_low=True)
        validation.flag("LoopOptions.log", self.log)
        if self.period is not None:
            validation.scalar("LoopOptions.period", self.period, low=0.0, open_low=True, unit="s")
