"""What a reader finds in a robot file, before it becomes a :class:`~wbc.robot.Robot`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import RobotFileError
from wbc.robot.robot import BASES
from wbc.validation import Array

ROOT = "root_joint"


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another, by name: q[follower] = ratio q[leader] + offset."""

    follower: str
    leader: str
    ratio: float
    offset: float


@dataclass(frozen=True, eq=False)
class Description:
    """A model with everything else that its file says; the position limits in ``model`` are the file's.

    Attributes:
        model: with the base joint, before any joint is locked.
        base: one of :data:`~wbc.robot.robot.BASES`.
        mimics: in the file's order; joints that do not move in ``model`` are left in.
        states: named configurations, joint name -> its numbers in q.
        acceleration: joint name -> limit, where the description knows it.
        notes: see :class:`~wbc.robot.Robot`.
        source: path of the file, "" for none.
    """

    model: pin.Model
    base: str = "fixed"
    mimics: tuple[Mimic, ...] = ()
    states: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    acceleration: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    source: str = ""


def root_joint(base: str) -> pin.JointModel | None:
    """The Pinocchio joint of a base, or None for a fixed one."""
    validation.one_of("base", base, BASES)
    if base == "fixed":
        return None
    return pin.JointModelFreeFlyer() if base == "floating" else pin.JointModelPlanar()


def own_base(model: pin.Model) -> str:
    """The base that a model has by itself: its only root joint is a free flyer or a planar joint."""
    roots = [j for j in range(1, model.njoints) if model.parents[j] == 0]
    if len(roots) != 1:
        return "fixed"
    kind = model.joints[1].shortname()
    return {"JointModelFreeFlyer": "floating", "JointModelPlanar": "planar"}.get(kind, "fixed")


def with_base(model: pin.Model, base: str | None, q: Array | None = None) -> tuple[pin.Model, str]:
    """(model, base) with the wanted base joint put under a model that has none of its own.

    A model that brings a base and shall be ``fixed`` has it locked where ``q`` (default: ``pin.neutral``) puts it.

    Raises:
        UnknownNameError: no such base.
        RobotFileError: the model brings a base of another kind.
    """
    has = own_base(model)
    if base is None:
        return model, has
    validation.one_of("base", base, BASES)
    if has != "fixed":
        if base == "fixed":
            return pin.buildReducedModel(model, [1], pin.neutral(model) if q is None else q), base
        if base == has or (has == "planar" and base == "differential"):
            return model, base
        raise RobotFileError("base", base, f"the description has a {has} base of its own")
    joint = root_joint(base)
    if joint is None:
        return model, base
    root = pin.Model()
    root.name = model.name
    index = root.addJoint(0, joint, pin.SE3.Identity(), ROOT)
    root.addJointFrame(index)
    merged = pin.appendModel(root, model, root.getFrameId(ROOT), pin.SE3.Identity())
    return merged, base


def finite_or_unlimited(array: Array) -> Array:
    """A copy where the "largest double" that some files use for none is infinity."""
    out = np.array(array, dtype=np.float64)
    out[np.abs(out) > 1e300] *= np.inf
    return out
