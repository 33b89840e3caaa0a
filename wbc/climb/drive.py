"""A body that is driven by rates: the source of plans of a loop, way after way."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.climber import Climber
from wbc.climb.goal import BodyPlace, LimbAt
from wbc.climb.limb_work import plan_limb_work
from wbc.climb.loop import ClimbLoop
from wbc.climb.loop.reference import PlanReference
from wbc.climb.motion import MoveError
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.scene import ClimbScene
from wbc.climb.search import NoStancesError, StanceOptions
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.climb.turn import BodyTurn, Guide
from wbc.errors import InfeasibleError, RangeError
from wbc.multibody import pin
from wbc.validation import Array

#: How long a way is planned ahead, one after the other where there are no footholds for it [s]
AHEAD = (8.0, 4.0, 2.0, 1.0)
#: Rates that changed twice within this time will change again: a way is planned 2 s ahead [s]
BUSY = 1.0
#: Rates below these are none [m/s, rad/s]
NONE = 1e-4
#: A way by rates has a pose after so much turn at least: half a turn and more looks like one the other way round [rad]
LEG = 2.0
#: How far ahead it is to come another way [s]
OTHERWISE = 2.0
#: Rates that a body may have at least where it goes another way round [m/s, rad/s]
SLOWEST = 0.01
#: Moves that are looked at for such a way, at most
FEW_MOVES = 400
#: How often a body goes over into another twist at most [s]
EVERY = 0.2
#: A body that is to go otherwise waits so long for limbs to land, else they land afterwards [s]
PATIENCE = 1.5
#: Footholds to which a limb in the air is brought, the nearest first, at most
LANDINGS = 6
#: How far the body has gone until that is tried again [m]
ELSEWHERE = 0.02
#: How long a body that is not to move stands before it is asked again [s]
STANDS = 0.1


class ClimbDrive:
    """Plans for a body that is to go at a twist, along its own axes,

        P(t) = P exp(t [v; w])

    as far as there are footholds for it: 8 s ahead, then 4, 2, 1, then it stands. A new twist is taken up at once while
    limbs land, where that is proven; else as soon as all hold. Between two ways the robot is at rest.

        drive = ClimbDrive(climber)
        loop = ClimbLoop(standing_plan(climber, scene, stance), replan=drive.following, onward=drive.onward)
        drive.steer([0.05, 0.0, 0.0, 0.0, 0.0, 0.0], loop);  loop.tick()

    Args:
        climber: what is driven.
        options: of each way.

    Attributes:
        stands: why it stands although it is to go; "" where it does not.
    """

    def __init__(self, climber: Climber, options: AlongOptions | None = None) -> None:
        self.climber, self.options, self.stands = climber, options or AlongOptions(), ""
        self._twist, self._ends = np.zeros(6), False
        # The largest speed and turn rate so far
        self._most = np.array([SLOWEST, SLOWEST])
        self._new, self._turned = False, -EVERY
        self._busy, self._changed = False, -BUSY
        self._over: BodyTurn | None = None
        self._aloft: tuple[tuple[int, ...], Array] = ((), np.zeros(3))

    def steer(self, twist: Any, loop: ClimbLoop) -> None:
        """The twist from now on (linear; angular) ``(6)`` [m/s, rad/s].

        Raises:
            ShapeError, NotFiniteError: no twist.
        """
        before = self._twist
        self.command(twist)
        if self._twist is not before:
            self._busy, self._changed = loop.time - self._changed < BUSY, loop.time
        if self._new and not loop.ended and loop.time >= self._turned + EVERY:
            self._new, self._turned = False, loop.time
            turned = self._turn(loop)
            if turned is None:
                lands = max((move.land for move in loop.coming if move.lift < loop.path_time), default=0.0)
                loop.redirect("other rates were commanded", lands > loop.path_time + PATIENCE)
            else:
                loop.go_over(turned)

    def command(self, twist: Any) -> None:
        """The twist ``(6)`` of what is planned from now on, where nothing is carried out yet.

        Raises:
            ShapeError, NotFiniteError: no twist.
        """
        asked = validation.real_array("twist", twist, (6,))
        if not np.array_equal(asked, self._twist):
            self._twist, self._new = asked, True
            self._most = np.maximum(self._most, _sizes(asked))

    def finish(self, loop: ClimbLoop) -> None:
        """It comes to rest and the run ends."""
        if not self._ends:
            # Limbs that found nothing near by are tried again, now that the body may go along
            self._ends, self._aloft = True, ((), np.zeros(3))
        self.steer(np.zeros(6), loop)

    def onward(self, scene: ClimbScene, stance: Stance) -> ContactPlan | None:
        """What comes after a plan that is done."""
        if not self._ends:
            return self.following(scene, stance)
        return self._landing(scene, stance)

    def following(self, scene: ClimbScene, stance: Stance) -> ContactPlan:
        """The way from a stance on; where there is none, one on which it stands."""
        self.stands = ""
        ahead, turned = _sizes(self._twist).tolist()
        if min(stance.contacts) < 0 and (landing := self._landing(scene, stance)) is not None:
            return self._meanwhile(landing) or landing
        if ahead <= NONE and turned <= NONE:
            return standing_plan(self.climber, scene, stance)
        if min(stance.contacts) >= 0:
            for seconds in AHEAD[2:] if self._busy else AHEAD:
                try:
                    return plan_along(self.climber, scene, self._track(stance, seconds), stance, self.options)
                except NoStancesError as error:
                    self.stands = self.stands or str(error)
        # Stances with other places of the body may lead on where none do along the way itself
        end = self._track(stance, OTHERWISE).poses[-1]
        options = self._freely(max(ahead, SLOWEST), max(turned, SLOWEST))
        try:
            plan = plan_climb(self.climber, scene, stance, BodyPlace(end.translation, end.rotation), options)
        except (NoStancesError, MoveError) as error:
            self.stands = f"{self.stands}; {error}" if self.stands else str(error)
            return standing_plan(self.climber, scene, stance)
        self.stands = ""
        return plan

    def _turn(self, loop: ClimbLoop) -> ContactPlan | None:
        """How the body goes over into its twist while limbs land; None: none does, or no such plan is proven."""
        plan, now, reference = loop.plan, loop.path_time, loop.reference
        moves = [replace(move, lift=0.0, land=move.land - now) for move in loop.coming if move.lift < now < move.land]
        held = {move.limb for move in moves}
        if not moves or not loop.steady or any(move.lands == FREE_LIMB for move in moves):
            return None
        contacts = tuple(FREE_LIMB if k in held else row for k, row in enumerate(loop.held))
        start, v = Stance(contacts, reference.q(now)), reference.derivatives(now)[0]
        return self._going(plan.scene, start, v, lambda time: reference.q(now + time), moves)

    def _meanwhile(self, landing: ContactPlan) -> ContactPlan | None:
        """A landing while the body goes at its twist, from rest; None: none is proven."""
        if not self._twist.any():
            return None
        start, still = Stance(landing.start, landing.q[0]), np.zeros(self.climber.robot.nv)
        return self._going(landing.scene, start, still, PlanReference(landing, self.climber.robot).q, landing.moves)

    def _going(
        self, scene: ClimbScene, start: Stance, v: Array, guide: Guide, moves: Sequence[ContactMove]
    ) -> ContactPlan | None:
        if self._over is None or self._over.scene is not scene:
            self._over = BodyTurn(self.climber, scene, self.options.motion)
        return self._over.planned(start, v, self._twist, guide, moves)

    def _landing(self, scene: ClimbScene, stance: Stance) -> ContactPlan | None:
        """A limb in the air comes down to a foothold that is near, and the body goes along where the drive ends and it
        has to; None: none can, or none could from near by.
        """
        place = self.climber.body_pose(stance.q).translation
        contacts, before = self._aloft
        if contacts == stance.contacts and np.linalg.norm(place - before) < ELSEWHERE:
            return None
        near = []
        for aloft in np.flatnonzero(np.array(stance.contacts) == FREE_LIMB).tolist():
            name, tip = self.climber.limbs[aloft].name, self.climber.contact_pose(stance.q, aloft).translation
            order = np.argsort(np.linalg.norm(scene.positions - tip, axis=1)).tolist()
            mine = [foothold for row in order if name in ((foothold := scene.footholds[row]).limbs or (name,))]
            near += [(name, foothold.id) for foothold in mine[:LANDINGS]]
        for limb, foothold in near:
            with contextlib.suppress(InfeasibleError, RangeError):
                return plan_limb_work(self.climber, scene, stance, limb, [foothold], self.options.motion)
        options = self._freely(*self._most.tolist())
        for limb, foothold in near if self._ends else []:
            with contextlib.suppress(NoStancesError, MoveError):
                return plan_climb(self.climber, scene, stance, LimbAt(limb, foothold), options)
        self._aloft = tuple(stance.contacts), place
        return None

    def _freely(self, speed: float, turn_rate: float) -> ClimbOptions:
        """Of plans over stances at such rates of the body at most."""
        stances, motion = StanceOptions(self.options.margin, self.options.limits, moves=FEW_MOVES), self.options.motion
        speeds = replace(motion.speeds, speed=speed, turn_rate=turn_rate)
        return ClimbOptions(stances, replace(motion, speeds=speeds), again=2)

    def _track(self, stance: Stance, seconds: float) -> BodyTrack:
        pose = self.climber.body_pose(stance.q)
        way, (speed, turn_rate) = seconds * self._twist, _sizes(self._twist)
        legs = max(1, int(np.ceil(seconds * turn_rate / LEG)))
        poses = [pose * pin.exp6(pin.Motion(part * way)) for part in np.arange(legs + 1) / legs]
        return BodyTrack(poses, max(float(speed), NONE), max(float(turn_rate), NONE))


def _sizes(twist: Array) -> Array:
    """Speed and turn rate of a twist ``(2)`` [m/s, rad/s]."""
    return np.asarray(np.linalg.norm(twist.reshape(2, 3), axis=1))


def standing_plan(climber: Climber, scene: ClimbScene, stance: Stance, seconds: float = STANDS) -> ContactPlan:
    """A plan on which nothing moves."""
    q = np.tile(np.asarray(stance.q, dtype=float), (2, 1))
    still: Array = np.zeros((2, climber.robot.nv))
    return ContactPlan(climber, scene, tuple(stance.contacts), [], np.array([0.0, seconds]), q, still)
