"""The bodies of some pairs as data: what carries them, and where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.proximity.body import Body, Pair, carrier_of
from wbc.symbolic.kinematics import WORLD, frame_index

if TYPE_CHECKING:
    from wbc.robot import Robot

#: Numbers of pairs or bodies
Index = NDArray[np.intp]


class PairScene:
    """Bodies and their pairs.

    Attributes:
        bodies: every body once, in the order in which the pairs name them.
        first, second: numbers of the bodies A and B of every pair.
        moving: whether a body moves from outside.
        joints: numbers of the joints that carry the bodies; 0 for those that none moves.
        places: poses of the shapes, moved to their centres, on the joint or in what moves from outside.
        outward: of every pair 1 if only B moves from outside, -1 if only A.
    """

    def __init__(self, robot: Robot, pairs: list[Pair], outside: frozenset[str]) -> None:
        self.robot = robot
        self.bodies: list[Body] = list(dict.fromkeys(body for pair in pairs for body in pair))
        number = {body: k for k, body in enumerate(self.bodies)}
        self.first: Index = np.array([number[a] for a, _ in pairs], dtype=np.intp)
        self.second: Index = np.array([number[b] for _, b in pairs], dtype=np.intp)
        self.moving = np.array([body.frame in outside for body in self.bodies])
        self.joints = [carrier_of(robot, body, outside) for body in self.bodies]
        centers = [body.shape.center for body in self.bodies]
        self.places = [self._on_joint(k) * pin.SE3(np.eye(3), center) for k, center in enumerate(centers)]
        self.outward = self.moving[self.second].astype(float) - self.moving[self.first].astype(float)

    def _on_joint(self, k: int) -> pin.SE3:
        body = self.bodies[k]
        if body.frame == WORLD or self.moving[k]:
            return body.placement
        frame = self.robot.model.frames[frame_index(self.robot.model, body.frame)]
        return frame.placement * body.placement
