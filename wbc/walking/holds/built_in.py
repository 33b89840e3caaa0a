"""Built-in structures: the published cylinder, a plane, a truss and a station module."""

from __future__ import annotations

import re
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.shapes import Box, Capsule
from wbc.walking.holds.hold import FREE, Hold, frame_of
from wbc.walking.holds.obstacle import Obstacle
from wbc.walking.holds.structure import Structure
from wbc.walking.holds.surface import CylinderSurface, PlaneSurface

#: Metres in an inch
INCH = 0.0254
#: The published cylinder: radius and axial pitch [m], rows T and A
RADIUS, PITCH, ROWS_T, ROWS_A = 100 * INCH, 9.25 * INCH, 25, 24
#: Longest module that is built [m]
LONGEST = 1e3
#: Tilt that a compliant hold allows [rad]
TILT = 0.05


def grid_angle(t: float) -> float:
    """ang(T) = 25 + 5 T degrees, of the published cylinder [rad]."""
    return radians(25.0 + 5.0 * t)


def grid_pose(t: float, a: float, radius: float = RADIUS, heading: float = 0.0) -> pin.SE3:
    """The nominal frame over grid coordinates (T, A), at ``radius`` [m] from the axis.

    Rz(-ang) Ry(90 deg) Rz(heading): z is the inward normal, x the direction of +A (-z of the structure) and y that of
    +T for heading 0 [rad].
    """
    angle = grid_angle(t)
    rotation = pin.utils.rotate("z", -angle) @ pin.utils.rotate("y", pi / 2) @ pin.utils.rotate("z", heading)
    return pin.SE3(rotation, np.array([radius * cos(pi - angle), radius * sin(pi - angle), -PITCH * a]))


def cylinder(rigid: bool = False, max_tilt: float = TILT) -> Structure:
    """The published cylinder: radius 100 in, 25 x 24 holds named "T,A", T = 1 to 25 and A = 1 to 24.

    Holds: x = 100 cos(180 - ang), y = 100 sin(180 - ang), z = -9.25 A [in]; free roll. ``rigid`` fixes the tilt.
    """
    tilt = 0.0 if validation.flag("rigid", rigid) else max_tilt
    holds = tuple(
        Hold(f"{t},{a}", grid_pose(t, a), FREE, tilt) for t in range(1, ROWS_T + 1) for a in range(1, ROWS_A + 1)
    )
    return Structure("cylinder", holds, surface=CylinderSurface(pin.SE3.Identity(), RADIUS))


def plane(rows: int = 16, columns: int = 24, pitch: float = PITCH, max_tilt: float = TILT) -> Structure:
    """A plane z = 0 with ``rows`` x ``columns`` holds named "T,A", at x = ``pitch`` A and y = ``pitch`` T [m].

    The walker is above: the approach direction is -z, x of a hold along +x.

    Raises:
        RangeError: fewer than one row or column, or no pitch.
    """
    for field, count in (("rows", rows), ("columns", columns)):
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise RangeError(field, count, "expected a whole number of at least 1")
    pitch = validation.scalar("pitch", pitch, low=0.0, open_low=True, unit="m")
    holds = tuple(
        Hold(f"{t},{a}", frame_of("hold", (pitch * a, pitch * t, 0.0), (0, 0, -1), (1, 0, 0)), FREE, max_tilt)
        for t in range(1, rows + 1)
        for a in range(1, columns + 1)
    )
    return Structure("plane", holds, surface=PlaneSurface(pin.SE3.Identity()))


def truss(bays: int = 6, side: float = 0.94, radius: float = 0.025, max_tilt: float = TILT) -> Structure:
    """A truss of square section along x whose upper face carries holds on three longerons and on every batten.

    Bars are capsules of ``radius`` [m]; a bay is as long as the section's ``side`` [m]. Holds are 1/4 bay apart on top
    of the bars and named "bar,number": "L1", "L2", "L3" for the longerons, "B0" ... for the battens. The approach
    direction is -z.

    Raises:
        RangeError: fewer than one bay, or a side or radius that is not positive.
    """
    if isinstance(bays, bool) or not isinstance(bays, int) or bays < 1:
        raise RangeError("bays", bays, "expected a whole number of at least 1")
    side = validation.scalar("side", side, low=0.0, open_low=True, unit="m")
    radius = validation.scalar("radius", radius, low=0.0, open_low=True, high=side / 8, unit="m")
    step, holds, bars = side / 4, [], []

    def add_bar(name: str, a: tuple[float, float, float], b: tuple[float, float, float]) -> None:
        bars.append(_bar(name, np.array(a), np.array(b), radius))

    def add_hold(name: str, x: float, y: float, along: tuple[int, int, int]) -> None:
        holds.append(Hold(name, frame_of("hold", (x, y, radius), (0, 0, -1), along), FREE, max_tilt))

    length = bays * side
    for number, y in enumerate((-side / 2, 0.0, side / 2), start=1):
        add_bar(f"L{number}", (0.0, y, 0.0), (length, y, 0.0))
        for k in range(4 * bays + 1):
            add_hold(f"L{number},{k}", k * step, y, (1, 0, 0))
    for bay in range(bays + 1):
        x = bay * side
        add_bar(f"B{bay}", (x, -side / 2, 0.0), (x, side / 2, 0.0))
        for k, y in ((1, -step), (2, step)):
            add_hold(f"B{bay},{k}", x, y, (0, 1, 0))
        for corner, y in (("left", -side / 2), ("right", side / 2)):
            add_bar(f"post {bay} {corner}", (x, y, 0.0), (x, y, -side))
            if bay < bays:
                add_bar(f"diagonal {bay} {corner}", (x, y, 0.0), (x + side, y, -side))
        add_bar(f"lower batten {bay}", (x, -side / 2, -side), (x, side / 2, -side))
    for corner, y in (("left", -side / 2), ("right", side / 2)):
        add_bar(f"lower longeron {corner}", (0.0, y, -side), (length, y, -side))
    return Structure("truss", tuple(holds), tuple(bars))


def module(length: float = 6.0, radius: float = 2.1, max_tilt: float = TILT) -> Structure:
    """A station module: a hull about the x axis with handrails, and three boxes of equipment that stand out.

    Handrails run along the hull every 6 degrees over its upper half and stand 0.07 m off it; grasp points are 0.22 m
    apart on top of them, in rails of three with a gap of 0.3 m. Ids are "rail,number"; grasp points within 0.15 m of a
    box are left out. The surface is that of the rails' tops, so that what stays above it clears the rails. The approach
    direction is towards the axis, x along +x.

    Raises:
        RangeError: a module too short for one rail, or a radius under 1 m.
    """
    length = validation.scalar("length", length, low=1.0, high=LONGEST, unit="m")
    radius = validation.scalar("radius", radius, low=1.0, unit="m")
    top, spacing, gap, per_rail = radius + 0.07, 0.22, 0.3, 3
    rail = (per_rail - 1) * spacing
    count = int((length + gap) // (rail + gap))
    holds = []
    for number, degrees in enumerate(range(-90, 91, 6)):
        turn = pin.utils.rotate("x", radians(degrees))
        outward = turn @ np.array([0.0, 0.0, 1.0])
        # Rails of neighbouring rows are half a period apart, as are the gaps between them
        start = (rail + gap) / 2 if number % 2 else 0.0
        for k in range(count * per_rail):
            x = start + (k // per_rail) * (rail + gap) + (k % per_rail) * spacing
            if x <= length:
                pose = frame_of("hold", top * outward + [x, 0.0, 0.0], -outward, (1, 0, 0))
                holds.append(Hold(f"{number},{k}", pose, FREE, max_tilt))
    boxes = []
    for name, x, degrees in (("valve box", 0.35, -40), ("camera box", 0.55, 10), ("antenna box", 0.75, 45)):
        turn = pin.utils.rotate("x", radians(degrees))
        centre = turn @ np.array([0.0, 0.0, top + 0.1]) + [x * length, 0.0, 0.0]
        boxes.append(Obstacle(name, Box((0.3, 0.2, 0.2)), pin.SE3(turn, centre)))
    axis = pin.SE3(pin.utils.rotate("y", pi / 2), np.zeros(3))
    kept = tuple(hold for hold in holds if all(box.distance(hold.position) >= 0.15 for box in boxes))
    return Structure("module", kept, tuple(boxes), CylinderSurface(axis, top))


#: Name -> function, as ``wbc walk --structure`` takes them
BUILT_IN = {"cylinder": cylinder, "plane": plane, "truss": truss, "module": module}


def remove_rows(structure: Structure, rows: Any) -> Structure:
    """The structure less all holds "T,A" whose A is within ``rows``: a number, or a text such as "12-14" or "3,12-14".

    Raises:
        RangeError: no such text, a row that no hold has, or holds that are not named by two whole numbers.
        ShapeError: no hold would be left.
    """
    return _remove(structure, "rows", rows, 1)


def remove_columns(structure: Structure, columns: Any) -> Structure:
    """The structure less all holds "T,A" whose T is within ``columns``; see :func:`remove_rows`."""
    return _remove(structure, "columns", columns, 0)


def remove_fraction(structure: Structure, fraction: float, seed: int = 0) -> Structure:
    """The structure less a random choice of ``fraction`` of its holds, rounded; the same seed, the same choice.

    Raises:
        RangeError: a fraction outside [0, 1]. ShapeError: no hold would be left.
    """
    validation.instance("structure", structure, Structure, "a Structure")
    share = validation.scalar("fraction", fraction, low=0.0, high=1.0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise RangeError("seed", seed, "expected a whole number of at least 0")
    order = np.random.default_rng(seed).permutation(len(structure))
    gone = sorted(order[: round(share * len(structure))].tolist())
    return structure.without([structure.ids[k] for k in gone])


def _remove(structure: Structure, field: str, wanted: Any, place: int) -> Structure:
    validation.instance("structure", structure, Structure, "a Structure")
    numbers = _numbers(field, wanted)
    keys = {hold: _grid_key(field, hold)[place] for hold in structure.ids}
    present = set(keys.values())
    lost = [n for n in numbers if n not in present]
    if lost:
        raise RangeError(field, wanted, f"no hold has {lost[0]}; they have {min(present)} to {max(present)}")
    return structure.without([hold for hold, number in keys.items() if number in numbers])


def _grid_key(field: str, hold: str) -> tuple[int, int]:
    match = re.fullmatch(r"(-?\d+),(-?\d+)", hold)
    if match is None:
        raise RangeError(field, hold, "this structure's holds are not named by two whole numbers T,A")
    return int(match[1]), int(match[2])


def _numbers(field: str, wanted: Any) -> list[int]:
    """Whole numbers out of a number or a text of numbers and ranges."""
    if isinstance(wanted, int) and not isinstance(wanted, bool):
        return [wanted]
    if not isinstance(wanted, str):
        raise ShapeError(field, wanted, "expected a whole number or a text such as '12-14'")
    out: list[int] = []
    for part in wanted.split(","):
        match = re.fullmatch(r"\s*(\d+)(?:\s*-\s*(\d+))?\s*", part)
        if match is None or int(match[2] or match[1]) < int(match[1]):
            raise RangeError(field, wanted, "expected numbers and ranges such as '3,12-14'")
        out += range(int(match[1]), int(match[2] or match[1]) + 1)
    return out


def _bar(name: str, a: np.ndarray, b: np.ndarray, radius: float) -> Obstacle:
    length = float(np.linalg.norm(b - a))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), (b - a) / length).matrix()
    return Obstacle(name, Capsule(radius, length), pin.SE3(turn, (a + b) / 2))
