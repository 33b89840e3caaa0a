"""A climber on its scene, driven from a page: by rates, or to a foothold that was clicked."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from wbc.climb.along import AlongOptions, BodyTrack, plan_along
from wbc.climb.climber import Climber
from wbc.climb.drive import ClimbDrive, standing_plan
from wbc.climb.first import first_stance
from wbc.climb.goal import BodyPlace
from wbc.climb.loop import ClimbLoop
from wbc.climb.places import body_over, surface_frames
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.planning import ClimbOptions, plan_climb
from wbc.climb.request import ClimberRequest, SceneRequest
from wbc.climb.scene import ClimbScene, size_of
from wbc.climb.search import NoStancesError
from wbc.climb.session import climber_of, scene_of
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.multibody import pin
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array
from wbc.viewer.beside import Viewer, show
from wbc.viewer.messages import RATE_LASTS, MessageError
from wbc.viewer.one_limb import OneLimb
from wbc.viewer.operation import Operation
from wbc.viewer.paced import ticks
from wbc.viewer.plan_aside import RESTS, PlanAside
from wbc.viewer.scenery import checked
from wbc.viewer.steering import SurfaceSteering
from wbc.viewer.walks import scenery_of

#: Speed of the body at full stick, as a share of the shortest limb's reach a second [1/s]
BODY_SPEED = 0.025
#: Its turn rate at full stick [rad/s]
TURN_SPEED = 0.04
#: Speed of a limb that is moved alone, as a share of that reach a second [1/s]
LIMB_SPEED = 0.04
#: Its turn rate [rad/s]
LIMB_TURN = 0.4
#: Parts of full speed that differ by less from those that are carried out are the same: another way is planned anew
OTHER = 0.25
#: A body within this of its destination is there [m]
THERE = 0.02
#: Points of a limb's way that are drawn
POINTS = 24


class WalkOperation(Operation):
    """Obeys a page for a climber: its messages are ``steer``, ``go``, ``ask``, ``approve``, ``arm`` and ``hand``.

    A stop is that of the loop: the robot comes to rest along its plan, and nothing is lifted. Plans are made in a
    thread beside the ticks; until one is there the robot stands, and stops when it is told to.

    Args:
        climber: what climbs. scene: what it climbs. stance: where it stands. backend: as of ``Stack.compile``.
        now: a clock [s].

    Attributes:
        loop: what carries plans out. waiting: the lift that waits for a yes, "" for none.
        limb: the one that is moved alone, None for none.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, stance: Stance, backend: str = "auto",
        now: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        self.climber, self.steering = climber, SurfaceSteering(climber)
        self._aside, self._now = PlanAside(climber), now
        self.loop = ClimbLoop(
            standing_plan(climber, scene, stance, RESTS), replan=self._aside.plan, onward=self._aside.plan,
            log=False, backend=backend,
        )  # fmt: skip
        super().__init__(self.loop.controller)
        self.loop.place = self._place
        reach = size_of(climber)
        self.speed = np.array([BODY_SPEED * reach, BODY_SPEED * reach, TURN_SPEED])
        self._limb_speed = np.array([LIMB_SPEED * reach] * 3 + [LIMB_TURN])
        self.limb: OneLimb | None = None
        # What ticks ask of the climber, beside the thread that plans
        self._here = replace(climber)
        self._drive: ClimbDrive | None = None
        self._planner, self._twist = ClimbDrive(climber), np.zeros(6)
        self._begins = tuple(foothold.id for foothold in scene.footholds)
        self._shown, self._said = tuple[Any, ...](), ""
        self._parts, self._until = np.zeros(0), 0.0
        self._answer: tuple[str, str] | None = None
        self._stands = self.loop.plan, True
        self._data = climber.robot.model.createData()

    # What a page says

    def check(self, message: Mapping[str, Any]) -> None:
        ids = tuple(foothold.id for foothold in self.loop.scene.footholds)
        checked(message, ids, tuple(limb.name for limb in self.climber.limbs))

    def obey(self, message: Mapping[str, Any]) -> None:
        """Do what a message says.

        Raises:
            WbcError: it does not fit; nothing has changed.
        """
        self.check(message)
        kind = message["type"]
        if kind in ("steer", "go", "arm", "hand") and self.stopped:
            raise MessageError("message", kind, f"the robot is stopped ({self.stopped}); resume first")
        if kind == "steer":
            if self.limb is not None:
                raise MessageError("message", kind, f"{self.limb.name} is moved alone, and the body stands")
            self._take_rates(np.array([float(x) for x in message["rates"]]))
        elif kind == "hand":
            if self.limb is None:
                raise MessageError("message", kind, "no limb is moved alone; choose one first")
            self._take_rates(np.array([float(x) for x in message["rates"]]))
        elif kind == "go":
            self._go(message["hold"])
        elif kind == "arm":
            self._take_limb(message["name"])
        elif kind == "ask":
            self.loop.approve, self.waiting = (self._approve if message["on"] else None), ""
        elif kind == "approve":
            self._answer, self.waiting = (self.waiting, ""), ""
        else:
            super().obey(message)

    def stop(self, reason: str) -> None:
        if not self.stopped:
            self.stopped = reason
            self._rest()
            self.loop.stop(reason)

    def resume(self) -> None:
        """Go on from there; the body stands until it is steered.

        Raises:
            MessageError: the run has ended.
        """
        if self.loop.ended:
            raise MessageError("message", "resume", f"the run has ended: {self.loop.result().reason}")
        if self.stopped:
            self.stopped = ""
            self.loop.carry_on()
            self.loop.redirect("the operator resumed")

    @property
    def planning(self) -> bool:
        """Whether a plan is being made."""
        return self._aside.planning

    # Ticks

    def tick(self) -> None:
        """One tick of the loop.

        Raises:
            PlantError: as of :meth:`wbc.climb.loop.ClimbLoop.tick`.
        """
        loop = self.loop
        if self._parts.any():
            if self._aside.awaited and self._stands[1]:
                # Nothing moves yet, and whoever renews the rates may be as busy as the planner
                self._until = self._now() + RATE_LASTS
            elif self._now() > self._until:
                self._take_rates(np.zeros(len(self._parts)))
        if self._drive is not None and not self.stopped and not loop.ended:
            before = loop.plan
            self._drive.steer(self._twist, loop)
            if loop.plan is not before:
                self._aside.foresee(loop.plan, loop.scene)
        if not loop.ended:
            loop.tick()
        if loop.ended and not self.stopped:
            self.stopped = loop.result().reason
        if loop.waiting is None:
            self.waiting = ""
        self._note()

    def _take_rates(self, parts: Array) -> None:
        """Parts of full speed, from now on for as long as a rate lasts."""
        self._until, known = self._now() + RATE_LASTS, self._parts
        known = known if len(known) == len(parts) else np.zeros(len(parts))
        if parts.any() == known.any() and np.abs(parts - known).max() < OTHER:
            return
        self._parts = parts
        if self.limb is None:
            self._steer(parts)
            return
        rates = self._limb_speed * parts
        self._aside.ask(partial(self.limb.by_rates, rates=rates) if parts.any() else None, again=True)
        self._redirect("other rates were commanded", at_once=self._alone)

    def _steer(self, parts: Array) -> None:
        """The body goes by parts of full speed."""
        scene, body = self.loop.scene, self._here.body_pose(self.loop.stance.q)
        self._twist = self.steering.twist(scene, body, self.speed * parts)
        self._drive = ClimbDrive(self._here) if self._drive is None else self._drive
        self._ask_drive(self._twist)

    def _ask_drive(self, twist: Array) -> None:
        """Plans are those of a drive at a twist, made by a drive of their own."""
        self._planner = ClimbDrive(self.climber)
        self._planner.command(twist)
        self._aside.ask(self._planner.following, again=bool(twist.any()))

    def _go(self, foothold: str) -> None:
        """To a foothold that was clicked: whatever is asked to move, else the body."""
        if self.waiting:
            self._answer, self.waiting = (self.waiting, foothold), ""
            return
        self._rest()
        if self.limb is not None:
            self._aside.ask(partial(self.limb.to_foothold, foothold=foothold))
        else:
            self._aside.ask(partial(self._body_to, foothold=foothold))
        self._redirect("another destination was chosen", at_once=self._alone)

    def _rest(self) -> None:
        """Nothing is asked for any more; limbs in the air come down."""
        self._parts, self._drive = np.zeros(0), None
        self._ask_drive(np.zeros(6))

    @property
    def _alone(self) -> bool:
        """Whether one limb is moved while all others hold: those in the air land first, or they would not bear it."""
        held = self.loop.held
        return self.limb is not None and FREE_LIMB not in held[: self.limb.row] + held[self.limb.row + 1 :]

    def _redirect(self, reason: str, at_once: bool = False) -> None:
        if not self.loop.ended and not self.stopped:
            self.loop.redirect(reason, at_once)

    def _take_limb(self, name: str) -> None:
        """This limb is moved alone from now on; "": none is."""
        if self.limb is not None and self.limb.name == name:
            return
        self._rest()
        self.limb = OneLimb(self.climber, name, self.steering) if name else None
        self._redirect("another limb was chosen")

    # Plans

    def _body_to(self, scene: ClimbScene, stance: Stance, foothold: str) -> ContactPlan:
        """The body comes over a foothold: along the surface, else as the planner of stances finds it."""
        begin = self.climber.body_pose(stance.q)
        end = self.steering.over(scene, begin, foothold)
        if np.linalg.norm(end.translation - begin.translation) < THERE:
            return standing_plan(self.climber, scene, stance)
        if min(stance.contacts) >= 0:
            try:
                track = BodyTrack((begin, end), float(self.speed[0]), TURN_SPEED)
                return plan_along(self.climber, scene, track, stance, AlongOptions())
            except NoStancesError:
                pass
        return plan_climb(self.climber, scene, stance, BodyPlace(end.translation), ClimbOptions())

    def _place(self, scene: ClimbScene, stance: Stance, limb: str, footholds: list[str]) -> ContactPlan:
        """A limb goes to another foothold than its plan has."""
        with self._aside.lock:
            return OneLimb(self.climber, limb, self.steering).to_foothold(scene, stance, footholds[0])

    def _approve(self, move: ContactMove) -> str | None:
        """The answer to a lift, once there is one."""
        named = self.loop.plan.told(move)
        if self._answer is not None and self._answer[0] == named:
            answer, self._answer = self._answer[1], None
            return answer
        self.waiting = named
        return None

    # What a page is told

    def _note(self) -> None:
        """After a tick: what a page is told of the climb, where it has changed."""
        loop, name = self.loop, "" if self.limb is None else self.limb.name
        coming = loop.coming[:2]
        reason = loop.refused if loop.approve is not None else ""
        if self._stands[0] is not loop.plan:
            self._stands = loop.plan, float(np.abs(loop.plan.v).max()) == 0.0
        stands = self._stands[1]
        if stands and self.planning:
            reason = "planning; the robot stands"
        elif self._aside.failed or (stands and self._drive is not None):
            reason = self._aside.failed or self._planner.stands or reason
        shown = (loop.scene, loop.plan, tuple(loop.states), tuple(map(id, coming)), name, reason, self.waiting)
        if shown == self._shown:
            return
        self._shown = shown
        ids, there = [foothold.id for foothold in loop.plan.scene.footholds], loop.scene.footholds
        left = {foothold.id for foothold in there}
        self.note = {
            "arm": name,
            "reason": reason,
            "waiting": self.waiting,
            "held": [there[row].id for row in loop.stance.contacts if row != FREE_LIMB],
            "reserved": sorted({ids[move.lands] for move in coming if move.lands != FREE_LIMB}),
            "gone": [foothold for foothold in self._begins if foothold not in left],
            "ways": [self._way(loop.plan, move) for move in coming],
        }

    def _way(self, plan: ContactPlan, move: ContactMove) -> list[list[float]]:
        """Some points of the way of a limb."""
        model, limb = self.climber.robot.model, self.climber.limbs[move.limb]
        knots = np.searchsorted(plan.times, np.linspace(move.lift, move.land, POINTS)).clip(max=len(plan.times) - 1)
        out = []
        for q in plan.q[knots]:
            pin.forwardKinematics(model, self._data, q)
            pose = pin.updateFramePlacement(model, self._data, frame_index(model, limb.frame)) * limb.placement
            out.append([float(x) for x in pose.translation])
        return out


def standing(climber: ClimberRequest, scene: SceneRequest, place: str = "") -> tuple[Climber, ClimbScene, Stance]:
    """A climber, a scene, and a first stance there.

    Args:
        place: as of :func:`wbc.climb.places.surface_frames`; "": the start of a family, else the middle foothold.

    Raises:
        NoStancesError: it cannot stand there. What :func:`wbc.climb.session.climber_of` and ``scene_of`` raise.
    """
    made = climber_of(climber)
    drawn = scene_of(scene, made)
    if place or not drawn.course:
        given = drawn.scene
        middle = np.linalg.norm(given.positions - given.positions.mean(axis=0), axis=1).argmin()
        frame = surface_frames(drawn.whole, [place or given.footholds[int(middle)].id])[0]
    else:
        frame = drawn.course[0]
    return made, drawn.scene, first_stance(made, drawn.scene, made.with_body(made.rest, body_over(made, frame)))


def climb(
    climber: Climber,
    scene: ClimbScene,
    stance: Stance,
    seconds: float | None = None,
    *,
    backend: str = "auto",
    announce: Callable[[Viewer], None] | None = None,
    **options: Any,
) -> None:
    """A climber on a scene in real time, driven from the page, until it or the time ends.

    Args:
        stance: where it stands, as of :func:`wbc.climb.first_stance`. options: as of :func:`wbc.viewer.show`.

    Raises:
        What :func:`wbc.viewer.show` raises.
    """
    operation = WalkOperation(climber, scene, stance, backend)
    loop, scenery = operation.loop, scenery_of(climber, scene, stance.q, np.array(stance.contacts))
    with show(loop.controller, operation=operation, scenery=scenery, **options) as viewer:
        if announce is not None:
            announce(viewer)
        for _ in ticks(viewer, loop.dt, seconds):
            operation.tick()
            if loop.step is not None:
                viewer.update(loop.step, loop.time)
