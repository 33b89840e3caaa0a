"""A frame at a time, as it comes: teleoperation of a robot by a person's motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.retarget.clip import Array, Skeleton
from wbc.retarget.correspondence import Correspondence
from wbc.retarget.engine import Engine
from wbc.retarget.mapping import LimbPlaces, Mapper, Places
from wbc.retarget.plan import (
    BEFORE,
    BLEND,
    LimbPlan,
    MotionPlan,
    in_the_air,
    logarithms,
    lowered,
    lowering,
    minimum_jerk,
    raised,
    standing_place,
    with_ankles,
)
from wbc.retarget.stances import FAST, HAND_HEIGHT, LEVEL, SLOW
from wbc.rotations import exponential

#: Time constant of the filter of speeds [s]
FILTER = 0.04
#: How fast the pelvis may rise again when standing legs no longer ask for it to be low [m/s]
RISE = 0.3


@dataclass
class _LiveLimb:
    """What is known of a limb from frame to frame: ends [m], filtered speed [m/s], its contact and its target."""

    ends: Array
    speed: float = 0.0
    slow: bool = False
    stands: bool = False
    share: float = 1.0
    place: Array = field(default_factory=lambda: np.zeros(3))
    heading: Array | None = None


class LiveRetargeter:
    """Follows frames as they come, with a delay of one frame; made by :meth:`wbc.retarget.Retargeter.live`.

        live = retargeter.live(rate=50.0)
        q = live.frame(points, turns)           # every 20 ms

    Stances are seen from the frames so far; a foot that slows down near the ground is brought to it and held.

    Attributes:
        rate: frames a second [Hz]. q: the last configuration; None before the first frame.
    """

    def __init__(self, match: Correspondence, engine: Engine, skeleton: Skeleton, rate: float, every: int) -> None:
        self.rate = rate
        self._match, self._engine, self._every = match, engine, every
        self._joints = len(skeleton.names)
        self._mapper = Mapper(match)
        rest = match.skeleton.rest
        legs = [m for m in match.limbs.values() if m.source.endswith("leg")] or list(match.limbs.values())
        self._leg = float(np.mean([np.linalg.norm(rest[m.base] - rest[m.end]) for m in legs]))
        self.reset()

    def reset(self) -> None:
        """Forget all frames: the next one is the first."""
        self._limbs: dict[str, _LiveLimb] = {}
        self._ankle: dict[str, float] = {}
        self._last: tuple[Array, Array] | None = None
        self._with_turns = False
        self._low = 0.0
        self.q: Array | None = None

    def frame(self, points: Any, turns: Any = None) -> Array:
        """The configuration after one more frame [nq].

        Args:
            points: of the skeleton, in the world, z up [joints, 3] [m]. turns: [joints, 3, 3]; None: not known.

        Raises:
            ShapeError, NotFiniteError: not such arrays; nothing is changed.
        """
        given = validation.real_array("points", points, (self._joints, 3))
        rotations = None if turns is None else validation.real_array("turns", turns, (self._joints, 3, 3))
        if self._last is not None and (turns is not None) != self._with_turns:
            raise ShapeError("turns", turns, "give turns in every frame or in none")
        self._with_turns = turns is not None
        self._look(given)
        places = self._mapper.places(given[None], None if rotations is None else rotations[None], self._ankle)
        plan = self._plan(places)
        now, held = self._engine.targets(plan), {name: limb.grip(0) for name, limb in plan.limbs.items()}
        if self._last is None or self.q is None:
            self.q = self._engine.start(*now, held)
        else:
            self.q = self._engine.follow(*_between(self._last, now, self._every), held, self.q)
        self._last = now
        return self.q.copy()

    def _look(self, points: Array) -> None:
        """Which limbs stand, as far as the frames so far say."""
        share = 1.0 - np.exp(-1.0 / (FILTER * self.rate))
        lowest = np.inf
        for name, match in self._match.limbs.items():
            ends = points[[match.end, match.tip]]
            limb = self._limbs.setdefault(name, _LiveLimb(ends))
            speed = float(((ends - limb.ends) ** 2).sum(axis=1).max()) ** 0.5 * self.rate
            limb.speed += share * (speed - limb.speed)
            limb.ends = ends
            limb.slow = limb.speed < (FAST if limb.slow else SLOW) * self._leg
            self._ankle[match.source] = min(self._ankle.get(match.source, np.inf), float(ends[0, 2]))
            if match.source.endswith("leg"):
                lowest = min(lowest, float(ends[:, 2].min()))
        for name, match in self._match.limbs.items():
            limb = self._limbs[name]
            near = LEVEL if match.source.endswith("leg") else HAND_HEIGHT
            limb.stands = limb.slow and float(limb.ends[:, 2].min()) < lowest + near * self._leg

    def _plan(self, places: Places) -> MotionPlan:
        """Targets of this frame, as a plan of one tick."""
        body = self._match.body
        eased = with_ankles(body, places.limbs, places.turn)
        limbs = {name: self._limb(name, limb, places.turn) for name, limb in eased.items()}
        plan = MotionPlan(places.pelvis, places.turn, places.chest, places.head, limbs, self._engine.dt)
        self._low = max(float(lowering(body, plan)[0]), self._low - RISE / self.rate)
        return lowered(body, plan, np.array([self._low]))

    def _limb(self, name: str, limb: LimbPlaces, turn: Array) -> LimbPlan:
        """A limb's target of this frame: on its way to the place where it stands, there, or on its way from it."""
        robot, state = self._match.body.limbs[name], self._limbs[name]
        if self._match.body.robot.base == "fixed":
            return in_the_air(limb)
        stands = state.stands
        if stands and state.share >= 1.0:
            state.place, state.heading = standing_place(robot, limb, turn, 0, 1)
        step = 1.0 / (BLEND * self.rate)
        state.share = max(state.share - step, 0.0) if stands else min(state.share + step, 1.0)
        flat = limb.rotation is not None and robot.contact == "flat"
        heading = state.heading if flat else None
        if state.share <= 0.0:
            end, rotation = state.place[None], limb.rotation if heading is None else heading[None]
        else:
            end, rotation = raised(robot, limb)
            share = float(minimum_jerk(np.array(state.share)))
            if share < 1.0:
                end = state.place + share * (end - state.place)
            if rotation is not None and heading is not None and share < 1.0:
                rotation = heading @ exponential(share * logarithms(heading.T @ rotation))
        held = np.array([stands and state.share * BLEND <= BEFORE])
        lies = np.array([not self._match.body.is_foot(name) and bool(state.place[2] <= robot.radius)])
        return LimbPlan(limb.base, limb.middle, limb.wrist, end, rotation, held, held, lies)


def _between(last: tuple[Array, Array], now: tuple[Array, Array], every: int) -> tuple[Array, Array]:
    """Positions and rotations of the ticks from one frame to the next, both included."""
    if every == 1:
        return np.concatenate([last[0], now[0]]), np.concatenate([last[1], now[1]])
    shares = np.linspace(0.0, 1.0, every + 1)[:, None, None]
    vectors = shares * logarithms(np.swapaxes(last[1][0], 1, 2) @ now[1][0])
    turned = exponential(vectors.reshape(-1, 3)).reshape(every + 1, -1, 3, 3)
    return last[0] + shares * (now[0] - last[0]), last[1] @ turned
