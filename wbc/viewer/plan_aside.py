"""Plans that are made beside a loop: until one is there the robot stands, and ticks go on."""

from __future__ import annotations

import threading
from concurrent.futures import Future

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
        #: Scene and stance from which a planner is at work, and what it finds
        self._work: tuple[ClimbScene, Stance, Future[ContactPlan]] | None = None
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
        return self._planner is not None and self._work is not None and not self._work[2].done()

    @property
    def awaited(self) -> bool:
        """Whether there is to be a plan, or one that no loop has taken yet."""
        return self._planner is not None and self._work is not None

    def plan(self, scene: ClimbScene, stance: Stance) -> ContactPlan:
        """For a loop: the plan from a stance on if it is there, else one on which the robot stands."""
        work = self._work
        if self._planner is None:
            return standing_plan(self._climber, scene, stance, RESTS)
        if work is None or work[0] is not scene or not self._fits(work[1], stance):
            self._begin(scene, stance)
        elif work[2].done():
            self._work = None
            try:
                plan = work[2].result()
            except WbcError as error:
                self.failed, self._planner = str(error), None
                return standing_plan(self._climber, scene, stance, RESTS)
            self.foresee(plan, scene)
            return plan
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
        self._begin(scene, Stance(plan.contacts_at(np.inf), plan.q[-1]))

    def _fits(self, planned: Stance, stance: Stance) -> bool:
        off = pin.difference(self._climber.robot.model, planned.q, stance.q)
        return planned.contacts == stance.contacts and bool(np.abs(off).max() < FITS)

    def _begin(self, scene: ClimbScene, stance: Stance) -> None:
        planner, found = self._planner, Future[ContactPlan]()
        self._work = scene, stance, found

        def run() -> None:
            with self.lock:
                # Somebody may have asked for another one meanwhile
                if planner is not None and self._work is not None and self._work[2] is found:
                    try:
                        found.set_result(planner(scene, stance))
                    except Exception as error:  # noqa: BLE001 (raised where the plan is taken)
                        found.set_exception(error)

        threading.Thread(target=run, name="planner", daemon=True).start()
