"""What a robot can stand on: points of it against a surface, with springs, dampers and friction."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from wbc import validation
from wbc.errors import RangeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Signed distance [m] of points ``[n, 3]`` from a surface, negative inside, as ``Structure.clearance`` is
Distance = Callable[[Array], Array]
#: Step of the difference quotient that gives the normal [m]
STEP = 1e-6
#: Deepest that a robot may be in a surface where it begins [m]
DEEPEST = 0.01


def level(height: float = 0.0) -> Distance:
    """The ground z = height [m]."""
    return lambda points: np.asarray(points)[..., 2] - height


@dataclass(frozen=True, eq=False)
class Ground:
    """Balls on frames of a robot touch a surface. Of a ball at depth d > 0, which came down at p0:

        f_n = max(0, stiffness d + damping dd/dt),
        f_t = -stiffness (p - p0)_t - damping v_t,  |f_t| <= friction f_n        (Cundall and Strack, 1979)

    p0 goes with the ball as far as the limit makes it slide, so that a foot at rest stays where it is.

    Attributes:
        points: frame -> radius of the ball about its origin [m].
        distance: of the surface; default: :func:`level` at 0.
        stiffness: [N/m]. damping: [N s/m]. friction: [1].

    Raises:
        ShapeError, NotFiniteError, RangeError: numbers that are none.
    """

    points: Mapping[str, float]
    distance: Distance = field(default_factory=level)
    stiffness: float = 5e4
    damping: float = 500.0
    friction: float = 0.8

    def __post_init__(self) -> None:
        points = validation.mapping("Ground.points", self.points, "frames to radii")
        radii = {name: validation.scalar(f"Ground.points[{name!r}]", radius, low=0.0, unit="m")
                 for name, radius in points.items()}  # fmt: skip
        object.__setattr__(self, "points", radii)
        validation.function("Ground.distance", self.distance)
        validation.own_scalars(self, "stiffness", low=0.0, open_low=True)
        validation.own_scalars(self, "damping", "friction", low=0.0)


class Touch:
    """The balls of one robot on its ground.

    Args:
        anchors: where each ball came down ``[n, 3]``, NaN for one in the air; a plant's state has them.

    Raises:
        UnknownNameError: no such frame.
    """

    def __init__(self, ground: Ground, robot: Robot, model: pin.Model) -> None:
        self.ground, self._model, self._data = ground, model, model.createData()
        self._frames = [model.getFrameId(robot.check_frame("Ground.points", name)) for name in ground.points]
        self._names, self._radii = tuple(ground.points), np.array(list(ground.points.values()))

    def fresh(self) -> Array:
        """All balls in the air."""
        return np.full((len(self._frames), 3), np.nan)

    def check(self, q: Array) -> None:
        """A robot may begin in touch with its ground, and not within it.

        Raises:
            RangeError: naming the frame and its depth.
        """
        pin.framesForwardKinematics(self._model, self._data, q)
        depth = self._radii - self.ground.distance(self._places())
        if len(depth) and depth.max() > DEEPEST:
            k = int(depth.argmax())
            reason = f"an impossible contact: {depth[k]:.3g} m inside of what it touches, {DEEPEST:g} is possible"
            raise RangeError("q", self._names[k], reason)

    def force(self, q: Array, v: Array, anchors: Array, settle: bool = False) -> Array:
        """Generalised force of all balls ``[nv]``; with ``settle`` the anchors move on to where they are now."""
        model, data, ground = self._model, self._data, self.ground
        pin.forwardKinematics(model, data, q, v)
        pin.updateFramePlacements(model, data)
        places = self._places()
        depth = self._radii - ground.distance(places)
        total = np.zeros(model.nv)
        for k in np.flatnonzero((depth > 0.0) | ~np.isnan(anchors[:, 0])):
            if depth[k] <= 0.0:
                if settle:
                    anchors[k] = np.nan
                continue
            frame = self._frames[k]
            speed = np.array(pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear)
            normal = self._normal(places[k])
            down = -float(normal @ speed)
            push = max(0.0, ground.stiffness * depth[k] + ground.damping * down)
            moved = np.zeros(3) if np.isnan(anchors[k, 0]) else places[k] - anchors[k]
            drag = -ground.stiffness * moved - ground.damping * speed
            drag -= (normal @ drag) * normal
            size, most = float(np.linalg.norm(drag)), ground.friction * push
            if size > most:
                drag *= most / size
            if settle:
                slid = -(drag + ground.damping * (speed + down * normal)) / ground.stiffness
                anchors[k] = places[k] - (slid - (normal @ slid) * normal) if size > most else places[k] - moved
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
            total += jacobian.T @ (push * normal + drag)
        return total

    def stiffness(self, q: Array) -> tuple[Array, Array]:
        """Of springs and dampers if all balls touched: J'kJ and J'dJ ``[nv, nv]``."""
        jacobians = [pin.computeFrameJacobian(self._model, self._data, q, f, pin.LOCAL_WORLD_ALIGNED)[:3]
                     for f in self._frames]  # fmt: skip
        square = sum((j.T @ j for j in jacobians), np.zeros((self._model.nv,) * 2))
        return self.ground.stiffness * square, self.ground.damping * square

    def _places(self) -> Array:
        return np.array([self._data.oMf[frame].translation for frame in self._frames]).reshape(-1, 3)

    def _normal(self, place: Array) -> Array:
        steps = STEP * np.eye(3)
        slope = self.ground.distance(place + steps) - self.ground.distance(place - steps)
        return np.asarray(slope / np.linalg.norm(slope))
