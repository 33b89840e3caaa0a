"""The curve of a swinging hand: straight off its hold along the normal, across, and straight onto the next hold."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, replace

import numpy as np

from wbc.robots import Margins, Walker
from wbc.validation import Array
from wbc.walking.arms.puma import limb_of
from wbc.walking.holds.structure import Structure
from wbc.walking.native import compiled
from wbc.walking.planner.around import Around, World, around
from wbc.walking.planner.grips.table import Ints

#: Parts of the curve, at its beginning and its end, in which the hand does not go across
UPRIGHT = 0.1
#: The rise is h (1 - (1 - 2x)^STEEP)
STEEP = 2
#: Points at which the height above the structure is measured
LOOKS = 9
#: Way over which the direction away from all that stands around is measured [m]
NEAR = 1e-3
#: Curves that are tried, the first that is clear is taken: how much higher in the middle, in ``Margins.higher``, and
#: what part of the arc
ALTERNATIVES = ((0.0, 1.0), (0.0, 0.6), (0.0, 0.2), (1.0, 1.0), (1.0, 0.4), (0.0, 1.4))


@dataclass(frozen=True, eq=False)
class Pivots:
    """Axes that m hands go round: those of the first joints of their arms, where the bodies are in the swings.

    Attributes:
        frames: of the arms' bases in the structure's frame ``[m, 4, 4]``. turn: about by how much joint 1 turns ``[m]``
            [rad].
    """

    frames: Array
    turn: Array


@dataclass(frozen=True, eq=False)
class Curves:
    """m curves in the structure's frame, over x in [0, 1]:

        p = c(y) + (r ((1 - y) h_a + y h_b) + 4 y (1 - y) l) u
        r = 1 - (1 - 2 x)^2,     u = -(1 - y) z_a - y z_b,     y = step((x - c) / (1 - 2 c))

    y, a third-degree step, is 0 over the first c of the curve and 1 over the last, so that the hand leaves and arrives
    along the normals. c(y) lies the part w between the chord a b and an arc round the axis of the arm's first
    joint, on which distance and angle change evenly: there joint 1 turns evenly, and the hand comes no nearer to it.

    Attributes:
        begin, end: a and b ``[m, 3]`` [m]. leave, arrive: approach directions z_a and z_b ``[m, 3]``.
        rise: h_a and h_b ``[m, 2]`` [m]. lift: l ``[m]`` [m].
        pivots: the axes. part: w.
    """

    begin: Array
    end: Array
    leave: Array
    arrive: Array
    rise: Array
    lift: Array
    pivots: Pivots
    part: float

    def at(self, x: Array) -> Array:
        """Positions at ``x`` ``[n]``: ``[m, n, 3]``."""
        y = step((x - UPRIGHT) / (1 - 2 * UPRIGHT))
        r, library = 1.0 - (1.0 - 2.0 * x) ** STEEP, compiled.library()
        if library is not None:
            out = np.empty((len(self.begin), len(x), 3))
            ends = self.begin, self.end, self.leave, self.arrive, self.rise, self.lift
            before = [compiled.packed(a) for a in (*ends, self.pivots.frames, self.pivots.turn)]
            after = [compiled.packed(a) for a in (y, r)]
            library.curves_at(
                *(ctypes.c_long(size) for size in out.shape[:2]),
                *map(compiled.at, before),
                ctypes.c_double(self.part),
                *(compiled.at(a) for a in (*after, out)),
            )
            return out
        height = r * (self.rise[:, :1] * (1.0 - y) + self.rise[:, 1:] * y) + 4.0 * y * (1.0 - y) * self.lift[:, None]
        s = y[None, :, None]
        up = self.leave[:, None] * (s - 1.0) - self.arrive[:, None] * s
        chord = self.begin[:, None] * (1.0 - s) + self.end[:, None] * s
        return np.asarray(chord + self.part * (self._arc(y) - chord) + height[..., None] * up)

    def _arc(self, y: Array) -> Array:
        """Positions on the arcs ``[m, n, 3]``."""
        turn, origin = self.pivots.frames[:, :3, :3], self.pivots.frames[:, :3, 3]
        first, last = (np.einsum("mji,mj->mi", turn, p - origin) for p in (self.begin, self.end))
        angle = np.arctan2(first[:, 1], first[:, 0])
        # The direction in which joint 1 turns
        change = np.arctan2(last[:, 1], last[:, 0]) - angle
        change += 2 * np.pi * np.round((self.pivots.turn - change) / (2 * np.pi))
        far = np.hypot(first[:, 0], first[:, 1]), np.hypot(last[:, 0], last[:, 1])
        at = angle[:, None] + change[:, None] * y
        distance = far[0][:, None] * (1.0 - y) + far[1][:, None] * y
        height = first[:, 2:] * (1.0 - y) + last[:, 2:] * y
        points = np.stack([distance * np.cos(at), distance * np.sin(at), height], axis=-1)
        out: Array = np.einsum("mij,mnj->mni", turn, points) + origin[:, None]
        return out


def step(part: Array) -> Array:
    """From 0 to 1 with the derivative 0 at both ends: s^2 (3 - 2 s), s clipped to [0, 1]."""
    s = np.clip(part, 0.0, 1.0)
    out: Array = s * s * (3.0 - 2.0 * s)
    return out


def crossing_height(walker: Walker) -> float:
    """How high above the structure a hand is to cross [m]: its radius and the clearance, and not under the published
    height.
    """
    tolerances, radius = walker.arm_data, limb_of(walker).radii[-1]
    return max(tolerances.lift_height, radius + tolerances.clearance) + walker.margins.crossing


def alternatives(margins: Margins) -> Array:
    """:data:`ALTERNATIVES` with heights in m ``[alternatives, 2]``."""
    return np.array(ALTERNATIVES) * [margins.higher, 1.0]


def curves(
    walker: Walker, structure: Structure, begin: Ints, end: Ints, pivots: Pivots, alternative: int = 0
) -> Curves:
    """Curves between holds, given by rows of the structure; one of :data:`ALTERNATIVES`."""
    more, part = alternatives(walker.margins)[alternative].tolist()
    a, b = structure.positions[begin], structure.positions[end]
    height, across = crossing_height(walker), walker.margins.across
    none, there = np.zeros((len(a), 2)), around(walker, structure)
    axes = there.approaches
    flat = Curves(a, b, axes[begin], axes[end], none, none[:, 0], pivots, part)
    if there.world is not None:
        rise, lift = _raised(there.world, flat, height, across)
        return replace(flat, rise=rise, lift=lift + more)
    flat = replace(flat, rise=np.repeat(_rise(flat, height, across)[:, None], 2, axis=1))
    return replace(flat, lift=_lift(there, flat, height) + more)


def between(
    walker: Walker,
    structure: Structure,
    ends: tuple[Array, Array],
    axes: tuple[Array, Array],
    free: Array,
    pivots: Pivots,
) -> Curves:
    """Curves of hands of which one end or both are in the air.

    Args:
        ends, axes: positions and z axes of the hands at the beginning and the end, ``[m, 3]`` each. free: which are in
            the air ``[m, 2]``.
    """
    height, flat = crossing_height(walker), Curves(*ends, *axes, np.zeros(free.shape), np.zeros(len(free)), pivots, 1.0)
    # From the air it need not rise more than it lacks, but must come down along the hold's normal
    there = around(walker, structure)
    lack = np.stack([np.maximum(height - there.height(end), 0.0) for end in ends], axis=1)
    # However a hand in the air is turned, it goes straight away from what it is near to
    near = (free > 0) & (lack > 0.0)
    leave, arrive = (
        np.where(near[:, side, None], -_upwards(there, ends[side]), axes[side]) if near[:, side].any() else axes[side]
        for side in (0, 1)
    )
    flat = replace(flat, leave=leave, arrive=arrive)
    rise = _rise(flat, height, walker.margins.across)[:, None]
    flat = replace(flat, rise=np.where(free, rise * lack / height, rise))
    return replace(flat, lift=_lift(there, flat, height))


def _upwards(there: Around, points: Array) -> Array:
    """The direction in which the distance from all that stands around grows ``[m, 3]``."""
    steps = 0.5 * NEAR * np.eye(3)
    slopes: Array = np.stack([there.height(points + way) - there.height(points - way) for way in steps], axis=1)
    out: Array = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-9)[:, None]
    return out


def _raised(world: World, flat: Curves, height: float, aside: float) -> tuple[Array, Array]:
    """Rise and lift of curves over what stands around, by compiled code."""
    library, count = compiled.library(), len(flat.begin)
    assert library is not None
    rise, lift = np.empty((count, 2)), np.empty(count)
    ends = flat.begin, flat.end, flat.leave, flat.arrive, flat.pivots.frames, flat.pivots.turn
    given = [compiled.packed(a) for a in ends]
    library.raise_curves(
        world.pointer,
        ctypes.c_long(count),
        *map(compiled.at, given),
        *(ctypes.c_double(number) for number in (flat.part, height, aside, UPRIGHT)),
        ctypes.c_long(len(_SPAN)),
        compiled.at(_SPAN_ACROSS),
        ctypes.c_long(LOOKS),
        compiled.at(_ACROSS),
        compiled.at(_LOOK_RAISED),
        ctypes.c_long(len(_HALF)),
        *(compiled.at(a) for a in (_HALF_STEPS, _HALF, rise, lift)),
    )
    return rise, lift


def _rise(flat: Curves, height: float, aside: float) -> Array:
    """h with which hands are at ``height`` [m] where they have come ``aside`` [m]."""
    points = flat.at(_SPAN)
    spans = np.sqrt((np.diff(points, axis=1) ** 2).sum(axis=2)).sum(axis=1)
    part = np.clip(aside / np.maximum(spans, 1e-9), 0.0, 0.5)
    x = UPRIGHT + (1 - 2 * UPRIGHT) * np.interp(part, _HALF_STEPS, _HALF)
    out: Array = height / (1.0 - (1.0 - 2.0 * x) ** STEEP)
    return out


def _lift(there: Around, flat: Curves, height: float) -> Array:
    """What curves lack between their ends, the chord of a round surface and obstacles included."""
    lack = (height - there.height(flat.at(_LOOK))) / (4.0 * _ACROSS * (1.0 - _ACROSS))
    out: Array = np.maximum(lack.max(axis=1), 0.0)
    return out


#: Places on curves at which their length is measured; steps over half a curve; where hands are looked at, and how far
#: across they are there
_SPAN, _HALF, _ACROSS = np.linspace(0.0, 1.0, 2 * LOOKS), np.linspace(0.0, 0.5, 129), np.linspace(0, 1, LOOKS + 2)[1:-1]
_HALF_STEPS, _WHOLE = step(_HALF), np.linspace(0.0, 1.0, 257)
_LOOK = UPRIGHT + (1 - 2 * UPRIGHT) * np.interp(_ACROSS, step(_WHOLE), _WHOLE)
_SPAN_ACROSS = step((_SPAN - UPRIGHT) / (1 - 2 * UPRIGHT))
_LOOK_RAISED = 1.0 - (1.0 - 2.0 * _LOOK) ** STEEP
#: What raising curves needs, as the compiled code wants it: where their length is measured, where hands are looked at,
#: how far they are raised there, and the steps over half a curve
RAISING = _SPAN_ACROSS, _ACROSS, _LOOK_RAISED, _HALF_STEPS, _HALF
