"""Plans that are made beside a loop: until one is there the robot stands, and ticks go on."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

import numpy as np

from wbc.climb.climber import Climber
from wbc.climb.drive import STANDS, standing_plan
from wbc.climb.loop.loop import Replan
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import Stance
from wbc.errors import WbcError
from wbc.multibody import pin

#: How long a robot for which nothing is to be planned stands before it is asked again [s]
RESTS = 600.0
#: A plan fits a stance whose joints are this near to its first ones [m, rad]
FITS = 1e-3


@dataclass(eq=False)
class _Planning:
    """A planner at work.

    Attributes:
        scene, stance: from which it plans. plan: what it found. error: why it found nothing. done: it has ended.
    """

    scene: ClimbScene
    stance: Stance
    plan: ContactPlan | None = None
    error: str = ""
    done: threading.Event = field(default_factory=threading.Event)


class PlanAside:
    """Asks a planner in a thread of its own, while the robot stands or carries out the plan before.

        aside = PlanAside(climber)
        loop = ClimbLoop(standing_plan(climber, scene, stance), replan=aside.plan, onward=aside.plan)
        aside.ask(planner);  loop.redirect("somewhere else");  loop.tick()

    Args:
        climber: what is planned for.

    Attributes:
        failed: why the planner found nothing; "" where it did, or is at work. lock: is held while a planner works.
    """

    def __init__(self, climber: Climber) -> None:
        self._climber, self.failed, self.lock = climber, "", threading.Lock()
        self._planner: Replan | None = None
        self._work: _Planning | None = None
        self._again = False

    def ask(self, planner: Replan | None, again: bool = False) -> None:
        """What plans from now on; what another one is at work at is not used.

        Args:
            planner: from a scene and a stance to a plan; None: the robot stands.
            again: once its plan begins it is asked for the one after that, and so on while the robot moves by them.
        """
        self._planner, self._again, self._work, self.failed = planner, again, None, ""

    @property
    def planning(self) -> bool:
        """Whether the planner is at work."""
        return self._planner is not None and self._work is not None and not self._work.done.is_set()

    @property
    def awaited(self) -> bool:
        """Whether there is to be a plan, or one that no loop has taken yet."""
        return self._planner is not None and self._work is not None

    def plan(self, scene: ClimbScene, stance: Stance) -> ContactPlan:
        """For a loop: the plan from a stance on if it is there, else one on which the robot stands."""
        work = self._work
        if self._planner is None:
            return standing_plan(self._climber, scene, stance, RESTS)
        if work is None or not self._fits(work, scene, stance):
            self._begin(scene, stance)
        elif work.done.is_set():
            self._work = None
            if work.plan is None:
                self.failed, self._planner = work.error, None
                return standing_plan(self._climber, scene, stance, RESTS)
            self.foresee(work.plan, scene)
            return work.plan
        return standing_plan(self._climber, scene, stance, STANDS)

    def foresee(self, plan: ContactPlan, scene: ClimbScene) -> None:
        """A plan begins now: what comes after it is planned meanwhile, as far as it is asked for."""
        if not self._again or self._planner is None:
            self._planner = None
            return
        if np.abs(plan.v).max() == 0.0:
            # It cannot go on: who asks again will be told so again
            self._planner = None
            return
        contacts = list(plan.start)
        for move in sorted(plan.moves, key=lambda move: move.land):
            contacts[move.limb] = move.lands
        self._begin(scene, Stance(tuple(contacts), plan.q[-1]))

    def _fits(self, work: _Planning, scene: ClimbScene, stance: Stance) -> bool:
        if work.scene is not scene or work.stance.contacts != stance.contacts:
            return False
        return bool(np.abs(pin.difference(self._climber.robot.model, work.stance.q, stance.q)).max() < FITS)

    def _begin(self, scene: ClimbScene, stance: Stance) -> None:
        work, planner = _Planning(scene, stance), self._planner
        self._work = work

        def run() -> None:
            try:
                with self.lock:
                    # Somebody may have asked for another one meanwhile
                    if planner is not None and self._work is work:
                        work.plan = planner(scene, stance)
            except WbcError as error:
                work.error = str(error)
            finally:
                work.done.set()

        threading.Thread(target=run, name="planner", daemon=True).start()
