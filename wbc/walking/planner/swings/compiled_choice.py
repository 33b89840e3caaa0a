"""The first curve of a swing that is possible and clear, by compiled code: a plan needs hundreds."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wbc.robots import Walker
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.planner.around import World
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.grips.rolls import ANY
from wbc.walking.planner.grips.table import Grips
from wbc.walking.planner.swings.curve import RAISING, STEEP, UPRIGHT, alternatives, crossing_height, step
from wbc.walking.planner.swings.joints import blend
from wbc.walking.planner.swings.least_time import rules
from wbc.walking.planner.swings.tracks import PASSES

#: arm, source, target, lift, last and soonest sample of a swing
Name = tuple[int, int, int, int, int, int]
_POINTERS = ("bases", "path", "places", "normals", "arms", "holds", "free")
_CURVES = ("across", "raised", "blend", "span", "look_across", "look_raised", "steps", "half")
_CLEAR = ("alternatives", "apart")
_COUNTS = ("count", "n", "spans", "looks", "halves", "tried", "halfway", "passes")
_NUMBERS = ("spacing", "height", "aside", "upright", "extra", "latch")


class _Scene(ctypes.Structure):
    """Scene of native/choice.h."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("arm", "rules", "world")),
        ("grips", compiled.Table),
        *((name, ctypes.c_void_p) for name in (*_POINTERS, *_CURVES, *_CLEAR)),
        *((name, ctypes.c_long) for name in _COUNTS),
        *((name, ctypes.c_double) for name in _NUMBERS),
    ]


class CompiledChoice:
    """Choice of curves for the swings of one plan.

    Args:
        shapes: of the arms. world: what stands around. apart: distances of links of a swinging arm and one that holds
            ``[15]`` [m]. points: of a curve. halfway: samples after lifting at which the body is about where the swing
            is halfway. extra: latches and settling [s]. latch: how long a hand opens [s].

    Raises:
        ValueError: compiled code does not know the limb.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        path: BodyPath,
        grips: Grips,
        shapes: LimbShapes,
        world: World,
        apart: Array,
        points: int,
        halfway: int,
        extra: float,
        latch: float,
    ) -> None:
        data = shapes.limb.closed_form
        if data is None:
            raise ValueError("only by compiled code")
        x, tried = np.linspace(0.0, 1.0, points), alternatives(walker.margins)
        y = step((x - UPRIGHT) / (1 - 2 * UPRIGHT))
        of_grips = grips.arm, np.maximum(grips.hold, 0), (grips.roll == ANY).astype(np.int64)
        curves = y, 1.0 - (1.0 - 2.0 * x) ** STEEP, blend(x), *RAISING
        distances = tried, apart
        reals = [compiled.packed(a) for a in (shapes.bases, path.poses, structure.positions, world.approaches)]
        whole = [np.ascontiguousarray(a, dtype=np.int64) for a in of_grips]
        more = [compiled.packed(a) for a in (*curves, *distances)]
        arrays = dict(zip((*_POINTERS, *_CURVES, *_CLEAR), (*reals, *whole, *more), strict=True))
        lengths = (len(arrays[name]) for name in ("path", "across", "span", "look_across", "half", "alternatives"))
        numbers = path.spacing, crossing_height(walker), walker.margins.across, UPRIGHT, extra, latch
        arm, limits = compiled.arm(data), rules(walker.margins)
        # What the pointers are to
        self._there = arrays, arm, limits, world, grips
        self._scene = _Scene(
            *(ctypes.cast(ctypes.pointer(a), ctypes.c_void_p) for a in (arm, limits)),
            ctypes.cast(world.pointer, ctypes.c_void_p),
            grips.table,
            *(compiled.at(array) for array in arrays.values()),
            *lengths,
            halfway,
            PASSES,
            *numbers,
        )

    def choose(
        self, names: Sequence[Name], others: Sequence[tuple[int, ...]], barred: NDArray[np.bool_]
    ) -> tuple[list[int], list[float]]:
        """Of swings the first alternatives that are possible and clear.

        Args:
            others: grips of the other arms. barred: what is not tried ``[m, alternatives]``.

        Returns:
            Alternatives, -1 for none, and durations of their laws [s].
        """
        library, count = compiled.library(), len(names)
        assert library is not None
        given = np.array(names, dtype=np.int64), np.array(others, dtype=np.int64)
        chosen, duration = np.empty(count, dtype=np.int64), np.empty(count)
        library.choose_swings(
            ctypes.byref(self._scene),
            ctypes.c_long(count),
            compiled.at(given[0]),
            ctypes.c_long(given[1].shape[1]),
            *(compiled.at(array) for array in (given[1], barred, chosen, duration)),
        )
        return chosen.tolist(), duration.tolist()
