"""Whether a machine can be meant to walk on a structure at all: holds in other units than metres show here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wbc.errors import RangeError
from wbc.robots import Walker
from wbc.walking.holds.built_in import BUILT_IN
from wbc.walking.holds.structure import Structure
from wbc.walking.run.request import Site

#: Units that files of holds are written in by mistake, and what they are in metres
UNITS = {"inches": 0.0254, "feet": 0.3048, "centimetres": 0.01, "millimetres": 0.001}

#: Rolls of a built-in hold for a body with two arms
FOLD = 8
#: Least and largest usual distance of neighbouring holds, over what two hands can be apart
SMALL = 0.02, 0.25


def hands_apart(walker: Walker) -> float:
    """More than two hands of a machine can be apart [m]: bases and arms stretched along one line."""
    data = walker.arm_data
    arm = data.upper_arm_length + data.forearm_length + data.hand_length
    return 2.0 * (float(np.hypot(data.shoulder_radius + data.shoulder_offset, data.neck_length)) + arm)


def ground(site: Site, walker: Walker) -> Structure:
    """The holds of a site for a machine. Two arms walk on one hand at a time, which has to say where the body is: holds
    that are built in then fix tilt and roll, every 360 / :data:`FOLD` degrees.

    Raises:
        RangeError: as of :func:`check_holds`; two arms on holds of a file on which hands may roll or lean. What the
            site raises.
    """
    structure = site.build()
    if len(walker.arms) == 2:
        if site.structure in BUILT_IN:
            holds = tuple(replace(hold, roll=FOLD, max_tilt=0.0) for hold in structure.holds)
            structure = replace(structure, holds=holds)
        for hold in structure.holds:
            if not hold.rolls or hold.max_tilt > 0.0:
                reason = "one of two hands alone does not fix the body where it may roll or lean (roll, max_tilt)"
                raise RangeError("arms", len(walker.arms), f"{reason}, as on hold {hold.id}")
    check_holds(structure, walker)
    return structure


def check_holds(structure: Structure, walker: Walker) -> None:
    """Refuses holds that no two hands can hold at once, or fewer than hands.

    Raises:
        RangeError: it says how far apart they are, and in which unit they would be near enough.
    """
    if len(structure) < len(walker.arms):
        reason = f"{len(walker.arms)} hands need as many holds, and there are {len(structure)}"
        raise RangeError("structure", structure.name, reason)
    least = float(_nearest(structure).min())
    if least > hands_apart(walker):
        reason = f"no two holds are nearer than {least:.3g} m, and hands are at most {hands_apart(walker):.3g} m apart"
        raise RangeError("structure", structure.name, f"{reason}{_unit(structure, walker)}")


def far_apart(structure: Structure, walker: Walker) -> str:
    """A remark on most holds being farther from all others than two hands can be; "" where they are not."""
    middle, most = float(np.median(_nearest(structure))), hands_apart(walker)
    if middle <= most:
        return ""
    apart = f"half of the holds are {middle:.3g} m and more from the next one, and hands at most {most:.3g} m apart"
    return f"{apart}{_unit(structure, walker)}"


def _nearest(structure: Structure) -> np.ndarray:
    """From each hold to the next one [m]."""
    from scipy.spatial import cKDTree  # takes long to import

    distances, _ = cKDTree(structure.positions).query(structure.positions, k=2)
    return np.asarray(distances[:, 1])


def _unit(structure: Structure, walker: Walker) -> str:
    """The units that a file is perhaps in: those in which holds are apart by a small part of what hands reach."""
    apart = float(np.median(_nearest(structure))) / hands_apart(walker)
    fitting = [name for name, size in UNITS.items() if SMALL[0] < apart * size < SMALL[1]]
    files = "; structure files are in metres"
    return f"{files}, is this one in {' or '.join(fitting)}?" if fitting else files
