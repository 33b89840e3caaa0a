"""One limb that a page moves while the others hold: its plans by rates and to a foothold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.climb.climber import Climber
from wbc.climb.let_go import lifts
from wbc.climb.limb_work import moved_by, plan_limb_work
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.errors import InfeasibleError, WbcError
from wbc.validation import Array
from wbc.viewer.steering import SurfaceSteering

#: How far ahead a motion by rates is planned; where that is not clear, less is tried [s]
LIMB_AHEAD = (1.5, 0.8, 0.4)
#: How far a limb that holds is lifted first, as shares of the shortest limb's reach, the first that is clear
LIMB_LIFTS = (0.02, 0.03, 0.04, 0.06, 0.08)
#: Speed at which it lifts at least [m/s]
SLOWEST_LIFT = 0.01


class OneLimb:
    """Plans of one limb, from stances in which the body stands.

    Args:
        climber: its robot. name: of the limb. steering: along the surface.
    """

    def __init__(self, climber: Climber, name: str, steering: SurfaceSteering) -> None:
        self.name, self.row = name, climber.row(name)
        self._climber, self._steering = climber, steering

    def by_rates(self, scene: ClimbScene, stance: Stance, rates: Array) -> ContactPlan:
        """Some way at rates: to the right, ahead, off the surface [m/s], turning to the left about its normal [rad/s].
        A limb that holds lifts off first, however it is to go on.

        Raises:
            InfeasibleError, MoveError: no way by them is clear, the others do not bear the robot, or it is to go into
                what it holds.
        """
        climber, row = self._climber, self.row
        pose = climber.contact_pose(stance.q, row)
        nearest = int(np.linalg.norm(scene.positions - pose.translation, axis=1).argmin())
        normal = scene.normals[nearest]
        ahead = self._steering.under(climber.body_pose(stance.q)).rotation[:, 0]
        ahead = ahead - (ahead @ normal) * normal
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
        axes = np.array([np.cross(ahead, normal), ahead, normal])
        twist = np.concatenate([rates[:3] @ axes, rates[3] * normal])
        ways = [(twist, seconds) for seconds in LIMB_AHEAD]
        if stance.contacts[row] != FREE_LIMB:
            if rates[2] < 0.0:
                raise InfeasibleError("limb", self.name, "it holds what it is to go into; lift it first")
            speed = max(float(np.abs(rates[:3]).max()), SLOWEST_LIFT)
            leave = [(float(np.linalg.norm(way)), way) for way in lifts(climber, stance.q, row, normal, LIMB_LIFTS)]
            ways = [(np.concatenate([speed / far * way, np.zeros(3)]), far / speed) for far, way in leave]
        for k, (way, seconds) in enumerate(ways):
            try:
                plan = plan_limb_work(climber, scene, stance, self.name, moved_by(pose, way, seconds)[-1:])
            except WbcError:
                if k == len(ways) - 1:
                    raise
            else:
                return slowed(plan, seconds)
        raise AssertionError

    def to_foothold(self, scene: ClimbScene, stance: Stance, foothold: str) -> ContactPlan:
        """It goes to a foothold and holds it.

        Raises:
            What :func:`wbc.climb.limb_work.plan_limb_work` raises.
        """
        return plan_limb_work(self._climber, scene, stance, self.name, [foothold])


def slowed(plan: ContactPlan, seconds: float) -> ContactPlan:
    """A plan that takes so long at least [s]."""
    share = max(seconds / float(plan.times[-1]), 1.0)
    moves = [replace(move, lift=share * move.lift, land=share * move.land) for move in plan.moves]
    return replace(plan, moves=moves, times=share * plan.times, v=plan.v / share)
