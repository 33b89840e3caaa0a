"""The handholds that an arm may go to. Units: grid units.

With b the base, o the centre of the body, p where the hand is and c a hold, all in the (T, A) plane, c is refused if

    1  it is the hold that the arm has
    2  |c - b| > radius, or |c - b| < r, r = (SN + 2) / 9.25
    3  the angle between b - o and c - b has a cosine below -0.707: a wedge of 90 degrees that faces the centre
    4  the line from p to c passes nearer to b than r: the distance of b from the line p c if the angles of the triangle
       at p and c are acute, else |c - b|
    5  the same with o and (R - SN - 2) / 9.25

A hold that another arm has is not refused. Source: M. R. Patterson's thesis, the listing HDHOLD.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.published.three_arm_walker.machine.arm import SN
from wbc.published.three_arm_walker.machine.grid import PITCH, Place, Terrain
from wbc.published.three_arm_walker.machine.reach import INNER, View
from wbc.validation import Array

#: Cosine at the edge of the wedge that faces the centre
SECTOR = -0.707


def handholds(view: View, arm: int, hand: Array, terrain: Terrain, held: Place | None) -> NDArray[np.int64]:
    """Places m x 2 that an arm may go to, T outer and A inner.

    Args:
        arm: 0 to 2. hand: (T, A) where it is. held: the place that is recorded for it.
    """
    base, reach = view.bases[arm], view.shoulders.reach
    places = terrain.places
    near = (np.abs(places - base) <= reach).all(axis=1)
    if held is not None:
        near &= (places != held).any(axis=1)
    places = places[near]
    if not len(places):
        return np.asarray(places)
    step = places - base
    size = np.hypot(step[:, 0], step[:, 1])
    outward = base - view.centre
    cosine = step @ outward / (np.hypot(*outward) * np.maximum(size, 1e-12))
    good = (size <= reach) & (size >= INNER) & (cosine >= SECTOR)
    places = places[good]
    middle = (view.shoulders.radius - SN - 2.0) / PITCH
    clear = _clear(places, hand, base, INNER) & _clear(places, hand, view.centre, middle)
    return np.asarray(places[clear])


def _clear(places: NDArray[np.int64], hand: Array, corner: Array, least: float) -> NDArray[np.bool_]:
    """Whether the line from the hand to each hold passes a corner at the least distance; by the cosine rule."""
    line, back, far = places - hand, hand - corner, places - corner
    aa, bb, cc = np.einsum("mi,mi->m", line, line), float(back @ back), np.einsum("mi,mi->m", far, far)
    flat = aa * bb * cc < 1e-12
    with np.errstate(divide="ignore", invalid="ignore"):
        at_place = (aa + cc - bb) / (2.0 * np.sqrt(aa * cc))
        at_hand = (aa + bb - cc) / (2.0 * np.sqrt(aa * bb))
    acute = (at_place > 0.0) & (at_hand > 0.0)
    distance = np.sqrt(cc) * np.where(acute, np.sqrt(np.maximum(1.0 - at_place**2, 0.0)), 1.0)
    return np.asarray(flat | (distance >= least))
