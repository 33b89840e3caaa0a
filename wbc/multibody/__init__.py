"""Poses, inertias, trees of joints and their numbers: Pinocchio where it is installed, else what is needed of it.

``pin`` is the one or the other. Both have the same names, conventions and order of coordinates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pinocchio as pin
else:
    try:
        import pinocchio as pin
    except ModuleNotFoundError:
        from wbc.multibody import own as pin

#: Whether ``pin`` is Pinocchio
PINOCCHIO = pin.__name__ == "pinocchio"
SE3 = pin.SE3

#: Components of an axis this much apart are the same
_ALIGNED = 1e-15
#: The least URDF with a continuous joint of an axis
_ENDLESS = (
    '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/><axis xyz="{} {} {}"/></joint></robot>'
)


def _endless(axis: Any) -> pin.JointModel:
    """A joint that turns about a unit vector and has (cos, sin) as coordinates."""
    if PINOCCHIO:
        # Python has no constructor of it that takes an axis
        return pin.buildModelFromXML(_ENDLESS.format(*(repr(float(x)) for x in axis))).joints[1]
    return pin.JointModelRevoluteUnboundedUnaligned(axis)


def single_joint(axis: NDArray[np.float64], *, slides: bool = False, endless: bool = False) -> pin.JointModel:
    """The joint that turns about, or slides along, a unit vector; one that knows its axis where it can.

    Args:
        axis: the vector. slides: along it. endless: turns about it with (cos, sin) as coordinates.
    """
    kinds = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned)
    if slides:
        kinds = (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelPrismaticUnaligned)
    elif endless:
        kinds = (pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ, _endless)
    along = np.flatnonzero(np.abs(axis - np.eye(3)).max(axis=1) < _ALIGNED)
    return kinds[along[0]]() if along.size else kinds[3](axis)


__all__ = ["PINOCCHIO", "SE3", "pin", "single_joint"]
