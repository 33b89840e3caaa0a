"""How a driver's rates along a surface become twists of the body."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.places import body_over
from wbc.climb.rates import round_surface
from wbc.climb.scene import ClimbScene
from wbc.climb.scenes import placed
from wbc.multibody import pin
from wbc.validation import Array


class SurfaceSteering:
    """Rates of a body along the surface under it: to the right and ahead, x of the climber at rest, and of turning
    about the surface's normal to the left. Over a cylinder without end the body goes round it.

    Args:
        climber: what is driven.
    """

    def __init__(self, climber: Climber) -> None:
        self._climber = climber
        self._under = climber.body_pose(placed(climber, pin.SE3.Identity())).inverse()

    def under(self, body: pin.SE3) -> pin.SE3:
        """Frame of the surface under a body: x ahead, z outwards."""
        return body * self._under

    def twist(self, scene: ClimbScene, body: pin.SE3, rates: Any) -> Array:
        """The twist (linear; angular) along the axes of a body at a pose ``(6)`` [m/s, rad/s].

        Args:
            rates: right, ahead [m/s], turning to the left [rad/s].

        Raises:
            ShapeError, NotFiniteError: no such rates.
        """
        right, ahead, left = validation.real_array("rates", rates, (3,))
        axes = self._under.rotation
        return round_surface(scene, body, np.concatenate([axes @ [ahead, -right, 0.0], left * axes[:, 2]]))

    def over(self, scene: ClimbScene, body: pin.SE3, foothold: str) -> pin.SE3:
        """The pose of a body over a foothold, turned by the smallest rotation from its surface to that one.

        Raises:
            UnknownNameError: no such foothold.
        """
        frame, there = self.under(body), scene.footholds[scene.row(foothold)].pose
        turn = pin.Quaternion.FromTwoVectors(frame.rotation[:, 2], there.rotation[:, 2]).matrix()
        return body_over(self._climber, pin.SE3(turn @ frame.rotation, there.translation))
