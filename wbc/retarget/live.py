"""A frame at a time, as it comes: teleoperation of a robot by a person's motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError
from wbc.retarget.clip import Array
from wbc.retarget.correspondence import Correspondence
from wbc.retarget.engine import Engine
from wbc.retarget.mapping import Mapper
from wbc.retarget.plan import BEFORE, BLEND, Planner, logarithms, minimum_jerk, turned_toward
from wbc.retarget.stances import FAST, HAND_HEIGHT, LEVEL, SLOW
from wbc.retarget.targets import Targets
from wbc.rotations import exponential

#: Time constant of the filter of speeds [s]
FILTER = 0.04
#: How fast the pelvis may rise again when standing legs no longer ask for it to be low [m/s]
RISE = 0.3


class LiveRetargeter:
    """Follows frames as they come, with a delay of one frame; made by :meth:`wbc.retarget.Retargeter.live`.

        live = retargeter.live(rate=50.0)
        q = live.frame(points, turns)           # every 20 ms

    Stances are seen from the frames so far; a foot that slows down near the ground is brought to it and held.

    Attributes:
        rate: frames a second [Hz]. q: the last configuration; None before the first frame.
    """

    def __init__(self, match: Correspondence, engine: Engine, rate: float, every: int) -> None:
        self.rate = rate
        self._match, self._engine, self._every = match, engine, every
        self._joints, rest = len(match.skeleton.names), match.skeleton.rest
        self._mapper = Mapper(match, rate)
        limbs = self._mapper.limbs
        self._planner = Planner(match.body, limbs)
        leads = [match.limbs[name] for name in limbs]
        self._sources, self._ends = [one.source for one in leads], np.array([(one.end, one.tip) for one in leads])
        self._of_legs = np.array([source.endswith("leg") for source in self._sources])
        self._hands = np.array([not match.body.is_foot(name) for name in limbs])
        self._radii = np.array([match.body.limbs[name].radius for name in limbs])
        legs = [one for one in leads if one.source.endswith("leg")] or leads
        leg = float(np.mean([np.linalg.norm(rest[one.base] - rest[one.end]) for one in legs]))
        #: speeds below which limbs come to stand and above which they go off, and how far from the ground they stand
        self._slowest, self._fastest = SLOW * leg, FAST * leg
        self._levels = np.where(self._of_legs, LEVEL, HAND_HEIGHT) * leg
        self.reset()

    def reset(self) -> None:
        """Forget all frames: the next one is the first."""
        count = len(self._sources)
        #: of limbs: ends [m], filtered speeds [m/s], and their heights where they were lowest [m]
        self._before, self._speeds, self._lowest = np.zeros((count, 2, 3)), np.zeros(count), np.full(count, np.inf)
        self._slow, self._stands = np.zeros((2, count), dtype=bool)
        #: share of the skeleton's path in an end's target, place and heading where it stands
        self._shares, self._places = np.ones(count), np.zeros((count, 3))
        self._headings = np.tile(np.eye(3), (count, 1, 1))
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
        self._look(given[self._ends])
        ankle = dict(zip(self._sources, self._lowest.tolist(), strict=True))
        targets = self._mapper.targets(given[None], None if rotations is None else rotations[None], ankle)
        self._planner.turn_ankles(targets)
        if self._match.body.robot.base != "fixed":
            self._stand(targets)
            ankles = self._planner.ankles(targets)
            self._low = max(float(self._planner.lowering(targets, ankles)[0]), self._low - RISE / self.rate)
            self._planner.lower(targets, np.array([self._low]), ankles)
        now, held = self._engine.table(targets), targets.grips(0)
        if self._last is None or self.q is None:
            self.q = self._engine.start(*now, held)
        else:
            self.q = self._engine.follow(*_between(self._last, now, self._every), held, self.q)
        self._last = now
        return self.q.copy()

    def _look(self, ends: Array) -> None:
        """Which limbs stand, as far as the frames so far say, of their ends and tips [limbs, 2, 3] [m]."""
        if self._last is not None:
            moved = ends - self._before
            speeds = np.sqrt(np.vecdot(moved, moved).max(axis=1)) * self.rate
            self._speeds += (1.0 - np.exp(-1.0 / (FILTER * self.rate))) * (speeds - self._speeds)
        self._before, low = ends, ends[:, :, 2].min(axis=1)
        self._slow = self._speeds < np.where(self._slow, self._fastest, self._slowest)
        self._lowest = np.minimum(self._lowest, ends[:, 0, 2])
        self._stands = self._slow & (low < low[self._of_legs].min(initial=np.inf) + self._levels)

    def _stand(self, targets: Targets) -> None:
        """Targets of limbs in this frame: where they stand, or on their way there or from there."""
        planner = self._planner
        for limb in np.flatnonzero(self._stands & (self._shares >= 1.0)).tolist():
            self._places[limb], heading = planner.standing_place(targets, limb, slice(0, 1))
            self._headings[limb] = np.eye(3) if heading is None else heading
        step = 1.0 / (BLEND * self.rate)
        shares = self._shares + np.where(self._stands, -step, step)
        self._shares = np.minimum(np.maximum(shares, 0.0), 1.0)
        paths = minimum_jerk(self._shares)
        targets.chains[0, :, 3] = self._places + paths[:, None] * (planner.raised(targets)[0] - self._places)
        if feet := [limb for limb in planner.flat if paths[limb] < 1.0]:
            turns = np.concatenate([targets.turns[planner.limbs[limb]] for limb in feet])
            turns = turned_toward(self._headings[feet], turns, paths[feet])
            targets.turns.update((planner.limbs[limb], turn[None]) for limb, turn in zip(feet, turns, strict=True))
            planner.keep_above(targets, [limb for limb in feet if paths[limb] > 0.0])
        targets.held[0] = targets.stands[0] = self._stands & (self._shares * BLEND <= BEFORE)
        targets.lies[0] = self._hands & (self._places[:, 2] <= self._radii)


def _between(last: tuple[Array, Array], now: tuple[Array, Array], every: int) -> tuple[Array, Array]:
    """Positions and rotations of the ticks from one frame to the next, both included."""
    if every == 1:
        return np.concatenate([last[0], now[0]]), np.concatenate([last[1], now[1]])
    shares = np.linspace(0.0, 1.0, every + 1)[:, None, None]
    vectors = shares * logarithms(np.swapaxes(last[1][0], 1, 2) @ now[1][0])
    turned = exponential(vectors.reshape(-1, 3)).reshape(every + 1, -1, 3, 3)
    return last[0] + shares * (now[0] - last[0]), last[1] @ turned
