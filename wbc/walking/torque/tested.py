"""What a plant has that a walk under torques runs on, and is tried on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from wbc.simulation import Grip, GrippingPlant, PlantState
from wbc.validation import Array


@runtime_checkable
class Tested(GrippingPlant, Protocol):
    """What a plant has besides that says how a walk does on it, and can be made to fail."""

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """At a configuration, at rest or with a velocity, and nothing grasped."""

    @property
    def grips(self) -> Mapping[str, Grip]:
        """Frame -> how it is held."""

    @property
    def wrenches(self) -> Mapping[str, Array]:
        """Frame -> what holds it exerts on the robot, in its axes and about its origin ``[6]`` [N, N m]."""

    @property
    def given(self) -> Array:
        """Momentum that it has given to its surroundings (linear; angular about the origin) [N s, N m s]."""

    @property
    def state(self) -> PlantState:
        """The truth."""

    def slip(self, frame: str, velocity: Any, duration: float) -> None:
        """What holds a frame moves [m/s] for some seconds."""

    def limp(self, joint: str, scale: float = 0.0) -> None:
        """A motor gives this part of its torque."""

    def lose(self, frame: str) -> None:
        """What holds a frame breaks off."""
