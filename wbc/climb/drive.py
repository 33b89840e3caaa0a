"""A body that is driven by rates: the source of plans of a loop, way after way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.climber import Climber
from wbc.climb.goal import BodyPlace
from wbc.climb.loop import ClimbLoop
from wbc.climb.motion import MoveError
from wbc.climb.plan import ContactPlan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.scene import ClimbScene
from wbc.climb.search import NoStancesError, StanceOptions
from wbc.climb.stance import Stance
from wbc.multibody import pin
from wbc.validation import Array

#: How long a way is planned ahead, one after the other where there are no footholds for it [s]
AHEAD = (8.0, 4.0, 2.0, 1.0)
#: Rates below these are none [m/s, rad/s]
NONE = 1e-4
#: How far ahead it is to come another way [s]
OTHERWISE = 2.0
#: Rates that a body may have at least where it goes another way round [m/s, rad/s]
SLOWEST = 0.02
#: Moves that are looked at for such a way, at most
FEW_MOVES = 400
#: How long a body that is not to move stands before it is asked again [s]
STANDS = 0.1


class ClimbDrive:
    """Plans for a body that is to go at a twist, along its own axes,

        P(t) = P exp(t [v; w])

    as far as there are footholds for it: 8 s ahead, then 4, 2, 1, then it stands. A new twist is taken up once all
    limbs hold and the robot is at rest; between two ways it is at rest.

        drive = ClimbDrive(climber)
        loop = ClimbLoop(standing_plan(climber, scene, stance), replan=drive.following, onward=drive.onward)
        drive.steer([0.05, 0.0, 0.0, 0.0, 0.0, 0.0], loop);  loop.tick()

    Args:
        climber: what is driven.
        about: a pose in the world about whose axes the twist is, as of a cylinder that is
            walked round, so that P(t) = exp(t [v; w]) P there; None: those of the body.
        options: of each way.

    Attributes:
        stands: why it stands although it is to go; "" where it does not.
    """

    def __init__(self, climber: Climber, about: Any = None, options: AlongOptions | None = None) -> None:
        self.climber, self.options, self.stands = climber, options or AlongOptions(), ""
        self._about = None if about is None else validation.pose("about", about)
        self._twist, self._ends = np.zeros(6), False

    def steer(self, twist: Any, loop: ClimbLoop) -> None:
        """The twist from now on (linear; angular) ``(6)`` [m/s, rad/s].

        Raises:
            ShapeError, NotFiniteError: no twist.
        """
        asked = validation.real_array("twist", twist, (6,))
        if not np.array_equal(asked, self._twist):
            self._twist = asked
            if not loop.ended:
                loop.redirect("other rates were commanded")

    def finish(self, loop: ClimbLoop) -> None:
        """It comes to rest and the run ends."""
        self._ends = True
        self.steer(np.zeros(6), loop)

    def onward(self, scene: ClimbScene, stance: Stance) -> ContactPlan | None:
        """What comes after a plan that is done."""
        return None if self._ends else self.following(scene, stance)

    def following(self, scene: ClimbScene, stance: Stance) -> ContactPlan:
        """The way from a stance on; where there is none, one on which it stands."""
        self.stands = ""
        ahead, turned = float(np.linalg.norm(self._twist[:3])), float(np.linalg.norm(self._twist[3:]))
        if ahead <= NONE and turned <= NONE:
            return standing_plan(self.climber, scene, stance)
        if min(stance.contacts) >= 0:
            for seconds in AHEAD:
                try:
                    return plan_along(self.climber, scene, self._track(stance, seconds), stance, self.options)
                except NoStancesError as error:
                    self.stands = self.stands or str(error)
        # Stances with other places of the body may lead on where none do along the way itself
        end = self._track(stance, OTHERWISE).poses[-1]
        options = self._freely(ahead, turned)
        try:
            plan = plan_climb(self.climber, scene, stance, BodyPlace(end.translation, end.rotation), options)
        except (NoStancesError, MoveError) as error:
            self.stands = f"{self.stands}; {error}" if self.stands else str(error)
            return standing_plan(self.climber, scene, stance)
        self.stands = ""
        return plan

    def _freely(self, ahead: float, turned: float) -> ClimbOptions:
        motion = self.options.motion
        speeds = replace(motion.speeds, speed=max(ahead, SLOWEST), turn_rate=max(turned, SLOWEST))
        stances = StanceOptions(self.options.margin, self.options.limits, moves=FEW_MOVES)
        return ClimbOptions(stances, replace(motion, speeds=speeds), again=2)

    def _track(self, stance: Stance, seconds: float) -> BodyTrack:
        pose = self.climber.body_pose(stance.q)
        way = pin.exp6(pin.Motion(seconds * self._twist))
        end = pose * way if self._about is None else self._about * way * self._about.inverse() * pose
        moved = pin.log6(pose.actInv(end)).vector
        speeds = [max(float(np.linalg.norm(part)) / seconds, NONE) for part in (moved[:3], moved[3:])]
        return BodyTrack((pose, end), speeds[0], speeds[1])


def standing_plan(climber: Climber, scene: ClimbScene, stance: Stance, seconds: float = STANDS) -> ContactPlan:
    """A plan on which nothing moves."""
    q = np.tile(np.asarray(stance.q, dtype=float), (2, 1))
    still: Array = np.zeros((2, climber.robot.nv))
    return ContactPlan(climber, scene, tuple(stance.contacts), [], np.array([0.0, seconds]), q, still)
