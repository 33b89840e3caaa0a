"""The loop of every mode: ticks until it is over, an abort where somebody asks for it, and how far things then go."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np

from wbc.errors import WbcError
from wbc.simulation import PlantError
from wbc.track.summary import Figure
from wbc.walking.loop.state import Tick
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.plan import HoldLost, NoPlanError
from wbc.walking.run.recording import WalkRecorder

#: How a mode ended: where it was to go, elsewhere, too late, its time over, by key, aborted, without the yes that it
#: asked for, or why it could not go on; and, whatever else it did, with something that the checker finds violated
Outcome = Literal[
    "arrived",
    "missed",
    "late",
    "time",
    "key",
    "interrupted",
    "declined",
    "hold lost",
    "plant failed",
    "refused",
    "violated",
]
#: Outcomes of a walk that did what it was to do
WELL: tuple[Outcome, ...] = ("arrived", "time", "key")
#: (what is done, how much of it from 0 to 1 or None)
Progress = Callable[[str, float | None], None]
#: Ticks between two reports of progress
STRIDE = 25
#: Ticks that are made after a stop, in which everything comes to rest
REST = 10
#: Ticks at most that a walk which is over has for joints that move while the body stands, as an arm turns upright
SETTLING = 300
#: Slower than this counts as at rest, where bodies have masses: the body [m/s] and joints [rad/s]
CREEP, TURN = 0.01, 0.05
#: So many joints that move are named
NAMED = 3


class CarryingOut:
    """Ticks of a walk, recorded.

    Args:
        tick: makes one; default: the walk's. stop: asked before every tick: true aborts.

    Attributes:
        outcome, reason: how it ended, "" while it goes on. figures: of an abort, for the summary.
    """

    def __init__(
        self,
        walk: Walk,
        recorder: WalkRecorder,
        *,
        tick: Callable[[], Tick] | None = None,
        progress: Progress | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        self.walk, self.recorder = walk, recorder
        self._tick, self._stop = tick or walk.tick, stop or (lambda: False)
        self._report = progress or (lambda what, part: None)
        self.outcome: Outcome | None = None
        self.reason = ""
        self.figures: tuple[Figure, ...] = ()
        self._most, self._seen = np.zeros(2), walk.plan
        self._look()

    def step(self, part: float | None = None, command: Any = None) -> bool:
        """One tick; whether to go on.

        Args:
            part: of the whole that is done. command: as of ``WalkRecorder.tick``.
        """
        if self.walk.plan is not self._seen:
            self._look()
        if self._stop():
            self.abort("interrupted", f"stopped at {self.walk.time:.2f} s")
            return False
        try:
            self.recorder.tick(self._tick(), command)
        except HoldLost as error:
            self.outcome, self.reason = "hold lost", str(error)
            if goes_on := self._goes_on():
                self.reason += f"; still in motion as the log ends: {goes_on}"
        except NoPlanError as error:
            self.outcome, self.reason = "refused", str(error)
        except PlantError as error:
            self.outcome, self.reason = "plant failed", str(error)
        except WbcError as error:
            # Such as a pose that the holding hands do not fix: what was walked until then is kept
            self.outcome, self.reason = "refused", str(error)
        failing = self.walk.machine.failing()
        if failing and self.outcome is None:
            self.abort("plant failed", failing)
            goes_on = self._goes_on()
            self.reason += f"; not all of it came to rest: {goes_on}" if goes_on else "; it was brought to rest"
        if len(self.recorder) % STRIDE == 0:
            self._report("walking", None if part is None else min(part, 1.0))
        return self.outcome is None

    def summary(self) -> tuple[Figure, ...]:
        """How far things would have gone after an abort, at most, and how far they went after one."""
        return (farthest(*self._most.tolist()), *self.figures)

    def _look(self) -> None:
        """Take a new plan into account."""
        self._seen = self.walk.plan
        self._most = np.maximum(self._most, self.walk.leader.stops.longest(self._seen))

    def _goes_on(self) -> str:
        """What of a robot with masses still moves, in words; "": nothing."""
        robot, rates = self.walk.walker.robot, self.walk.machine.lasting
        speed = float(np.linalg.norm(rates[:3]))
        parts = [f"the body moves at {1e3 * speed:.0f} mm/s"] if speed > CREEP else []
        sizes = np.abs(rates) * (np.arange(robot.nv) >= robot.base_nv)
        moves = [int(k) for k in np.argsort(-sizes) if sizes[k] > TURN]
        parts += [f"{robot.dof_names[k]} at {rates[k]:.2f} rad/s" for k in moves[:NAMED]]
        if len(moves) > NAMED:
            parts.append(f"{len(moves) - NAMED} more joints")
        return ", ".join(parts)

    def abort(self, outcome: Outcome, reason: str) -> None:
        """Bring everything to rest, and keep how far it went beside what was said before."""
        walk = self.walk
        self.outcome, self.reason = outcome, reason
        bounds, swinging = walk.stopping(), walk.swinging
        begin, hands, left = walk.q[:3].copy(), walk.machine.chain.origins.copy(), REST
        far = np.zeros(2)
        walk.abort()
        while left:
            try:
                self.recorder.tick(walk.tick())
            except (HoldLost, PlantError):
                break
            far[0] = max(far[0], float(np.linalg.norm(walk.q[:3] - begin)))
            if swinging is not None:
                moved = walk.machine.chain.origins[swinging.arm] - hands[swinging.arm]
                far[1] = max(far[1], float(np.linalg.norm(moved)))
            left -= int(walk.still)
        self.figures = (travelled((float(far[0]), float(far[1])), bounds),)


def settle(walk: Walk, recorder: WalkRecorder) -> None:
    """Ticks until joints are so slow that they can stand from one tick to the next: a log ends at rest."""
    slow = walk.walker.robot.limits.acceleration[6:] * walk.dt
    walk.abort()
    for _ in range(SETTLING):
        if not (np.abs(walk.v[6:]) > slow).any():
            return
        recorder.tick(walk.tick())


def farthest(body: float, hand: float) -> Figure:
    """How far a body and a hand go after an abort, at most [m]."""
    text = f"body at most {1e3 * body:.0f} mm, hand at most {1e3 * hand:.0f} mm"
    return Figure("stopping", "travel after an abort", {"body": body, "hand": hand}, text)


def travelled(far: tuple[float, float], bounds: tuple[float, float]) -> Figure:
    """How far a body and a hand went after an abort [m], beside what had been said before."""
    value = {"body": far[0], "hand": far[1], "body_bound": bounds[0], "hand_bound": bounds[1]}
    text = (
        f"body {1e3 * far[0]:.1f} mm of {1e3 * bounds[0]:.1f} mm, hand {1e3 * far[1]:.1f} mm of "
        f"{1e3 * bounds[1]:.1f} mm that were said before"
    )
    return Figure("abort", "travelled after the abort", value, text)
