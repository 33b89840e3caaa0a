"""The sweep of a scene over a motion, and what it proves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.clearance.motion import Motion
from wbc.clearance.native import NativeSweep
from wbc.clearance.scene import Exemption, SweptScene
from wbc.errors import RangeError, ShapeError
from wbc.validation import Array

#: What a sweep looks for: the least of every pair, the least of all pairs, or any pair that is nearer than it may be
AIMS = ("every", "least", "any")


@dataclass(frozen=True, eq=False)
class Nearest:
    """Two bodies at an instant.

    Attributes:
        pair: number in the scene. first, second: names. time: [s].
        distance: signed [m]. required: what it must be, less where an exemption holds. points: nearest ones [2, 3] m.
    """

    pair: int
    first: str
    second: str
    time: float
    distance: float
    required: float
    points: Array

    def __str__(self) -> str:
        text = f"{self.first} and {self.second}: {1e3 * self.distance:.1f} mm at {self.time:.3f} s"
        return f"{text}, {1e3 * self.required:.1f} mm required"


@dataclass(frozen=True, eq=False)
class Sweep:
    """What is proven over a motion. A margin is a distance less what is required; where an exemption holds, what is
    left of it.

    Attributes:
        pairs: numbers of those that were looked at [p].
        bound: proven least margin [p]: at no instant of the motion is it less [m]; -inf where the sweep stopped before.
        found: least margin at an instant that was looked at [p]; inf where the bound needed none.
        times: of those instants [p] s.
        tolerance: [m].
        nearest: the pair of the least margin that was found; None where no exact distance was needed.
        measured: exact distances and pieces of the motion that it took.
    """

    pairs: NDArray[np.intp]
    bound: Array
    found: Array
    times: Array
    tolerance: float
    nearest: Nearest | None
    measured: tuple[int, int]

    @property
    def clear(self) -> bool:
        """At no instant that was looked at is a pair too near; proven, at none by more than the tolerance."""
        return self.violation is None and bool((self.bound >= -self.tolerance * (1.0 + 1e-9)).all())

    @property
    def violation(self) -> Nearest | None:
        """An instant at which two bodies are nearer than they may be; None where none was found."""
        return self.nearest if len(self.found) and float(self.found.min()) < 0.0 else None


class Sweeper:
    """Sweeps of a scene.

        tree = Tree.of_model(model)
        hand, post = SweptBody("hand", Capsule(0.05, 0.2), "hand"), SweptBody("post", Cylinder(0.03, 1.0))
        scene = SweptScene(tree, [hand, post], [Pair("hand", "post", 0.025)])
        swept = Sweeper(scene).sweep(Motion.linear(tree, times, q))
        if not swept.clear:
            print(swept.nearest)

    With d the distance of two bodies in the middle of a piece of the motion, and m no less than the way of any of their
    points from there, d - m is a lower bound over the piece; where it is not enough, both halves are looked at
    (conservative advancement: Mirtich, Impulse-based dynamic simulation, 1996). m = sum_j |q_j - q_j(middle)| r_j along
    the chain from the body to what carries both, with r_j the reach of the body about joint j, all in the middle; or,
    within a piece between two knots, its bound of second order (``native/motion.h``), where that is less.

    Raises:
        CompileError: the C that does it was not compiled ahead, and there is no compiler, or it fails.
    """

    def __init__(self, scene: SweptScene) -> None:
        self.scene = validation.instance("scene", scene, SweptScene, "a SweptScene")
        self._sweep = NativeSweep(scene)

    def sweep(
        self,
        motion: Motion,
        pairs: Any = None,
        exemptions: Sequence[Exemption] = (),
        *,
        aim: str = "any",
        tolerance: float = 1e-4,
        far: float = 0.0,
    ) -> Sweep:
        """What is proven over a motion.

        Args:
            pairs: numbers of those that count; None: all.
            aim: ``any`` stops at the first instant found at which a pair is nearer than it may be; ``least``: the least
                margin of all pairs, within the tolerance; ``every``: of each pair.
            tolerance: of the proof [m].
            far: margins above this are not looked at more closely [m]; the bounds are at least that, then.

        Raises:
            ShapeError: a motion of another tree. RangeError: a pair that is not there, a tolerance that is not
            positive. What :meth:`SweptScene.exempt` raises. UnknownNameError: no such aim.
        """
        number = AIMS.index(validation.one_of("aim", aim, AIMS))
        tolerance = validation.scalar("tolerance", tolerance, low=0.0, open_low=True, unit="m")
        far = inf if far == inf else validation.scalar("far", far, unit="m")
        chosen = self._chosen(pairs)
        self._check(motion)
        entries = self.scene.exempt(exemptions, motion.times)
        stopped = self._sweep.sweep(motion, chosen, entries, number, tolerance, far)
        low, high, when = (np.array(column[chosen]) for column in (self._sweep.low, self._sweep.high, self._sweep.when))
        if stopped is not None:
            low[:] = -inf
        best = int(np.argmin(high)) if len(chosen) else 0
        nearest = None
        if len(chosen) and high[best] < inf:
            nearest = self._nearest(int(chosen[best]), float(when[best]), motion)
        times = np.interp(when, np.arange(len(motion.times)), motion.times)
        return Sweep(chosen, low, high, times, tolerance, nearest, self._sweep.measured)

    def at(self, motion: Motion, time: float, pairs: Any = None) -> tuple[Nearest, ...]:
        """Distances and nearest points of pairs at a time of a motion [s]; no exemption holds.

        Raises:
            as :meth:`sweep`.
        """
        chosen = self._chosen(pairs)
        self._check(motion)
        low, high = float(motion.times[0]), float(motion.times[-1])
        when = motion.knots(validation.scalar("time", time, low=low, high=high, unit="s"))
        self._sweep.sweep(motion, chosen[:0], (), 0, 1.0, 0.0)
        return tuple(self._nearest(int(pair), when, motion) for pair in chosen)

    def _nearest(self, pair: int, knots: float, motion: Motion) -> Nearest:
        out = self._sweep.at(pair, knots)
        which = self.scene.pairs[pair]
        points, distance = out[1:7].reshape(2, 3), float(out[0])
        return Nearest(pair, which.first, which.second, motion.time(knots), distance, distance - float(out[7]), points)

    def _chosen(self, pairs: Any) -> NDArray[np.intp]:
        count = len(self.scene.pairs)
        if pairs is None:
            return np.arange(count)
        given = pairs if isinstance(pairs, np.ndarray) else validation.items("pairs", pairs, "numbers")
        try:
            chosen = np.asarray(given)
        except ValueError as error:
            raise ShapeError("pairs", pairs, "expected numbers of pairs, each once") from error
        if not chosen.size:
            return np.zeros(0, dtype=np.intp)
        if chosen.ndim != 1 or chosen.dtype.kind not in "iu" or len(np.unique(chosen)) != len(chosen):
            raise ShapeError("pairs", pairs, "expected numbers of pairs, each once")
        if chosen.min() < 0 or chosen.max() >= count:
            raise RangeError("pairs", int(chosen[np.argmax(np.abs(chosen))]), f"expected numbers from 0 to {count - 1}")
        return chosen.astype(np.intp)

    def _check(self, motion: Motion) -> None:
        validation.instance("motion", motion, Motion, "a Motion")
        tree = self.scene.tree
        found, wanted = (motion.controls.shape[1], len(motion.poses)), (len(tree.coordinates), len(tree.free))
        if found != wanted:
            raise ShapeError("motion", found, f"expected {wanted[0]} scalars and {wanted[1]} free poses")
