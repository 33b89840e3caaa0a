"""What the thesis leaves out: every number that its text and listing do not print. SI units."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, fields
from typing import Literal

import numpy as np

from wbc import validation
from wbc.published.three_arm_walker.machine.grid import INCH

#: Where the text and the listing disagree both are there; the listing is what ran
Variant = Literal["listing", "text"]


@dataclass(frozen=True)
class WalkerCalibration:
    """Assumed numbers, none of which is printed but ``grasp_tolerance``.

    The hand's speed and acceleration were chosen so that the model walks along the cylinder at the published 3 in/s
    but not at 4 in/s, and the shoulder radius so that it crosses a trench of 0.81 of the reach diameter, published as
    four fifths: what the model does at these speeds and trenches confirms nothing.

    Attributes:
        shoulder_radius: R, from the centre of the body to each arm base [m].
        hand_speed: MAXTRV [m/s]. hand_acceleration: MAXTRA [m/s^2].
        hand_angular_acceleration: MAXROA [rad/s^2].
        corner_deviation: ERRMAX, largest distance of a swing from its via points [m].
        joint_rates: JVLIM, 6 [rad/s]; figures commonly quoted for the PUMA 560.
        grasp_tolerance: TTRERR [m], printed: 1 in. grasp_angle: TROERR [rad].
        grasp_speed: TTRVEL [m/s]. grasp_rate: TROVEL [rad/s]. Both are what an error at its tolerance commands, so
            that they refuse nothing that the tolerances let pass.

    Raises:
        ShapeError, NotFiniteError, RangeError: what is no positive number.
    """

    shoulder_radius: float = 12.0 * INCH
    hand_speed: float = 20.0 * INCH
    hand_acceleration: float = 40.0 * INCH
    hand_angular_acceleration: float = 4.0
    corner_deviation: float = 1.0 * INCH
    joint_rates: tuple[float, ...] = tuple(np.radians([82.0, 74.0, 122.0, 228.0, 241.0, 228.0]).tolist())
    grasp_tolerance: float = 1.0 * INCH
    grasp_angle: float = 0.1
    grasp_speed: float = 10.0 * INCH
    grasp_rate: float = 1.0

    @property
    def digest(self) -> str:
        """Hash of all numbers; every run prints it."""
        text = json.dumps(asdict(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = f"WalkerCalibration.{field.name}", getattr(self, field.name)
            if field.name == "joint_rates":
                rates = validation.real_array(name, value, (6,)).tolist()
                checked: float | tuple[float, ...] = tuple(
                    validation.scalar(f"{name}[{k}]", rate, low=0.0, open_low=True, unit="rad/s")
                    for k, rate in enumerate(rates)
                )
            else:
                checked = validation.scalar(name, value, low=0.0, open_low=True)
            object.__setattr__(self, field.name, checked)
