"""What a reader finds in a robot file, before it becomes a :class:`~wbc.robot.Robot`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import field
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import RobotFileError
from wbc.multibody import algebra, own, pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.loops import AnyLoop
from wbc.robot.rebuilt import on_joint, without_joints
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
        undriven: joints with several degrees of freedom that no motor moves, the base left out.
        geometry: the ``mujoco.MjModel``, or the root element of the URDF file, that has the shapes; None: the file has
            them.
        loops: closed loops, between frames of ``model``.
        actuated: joints with motors; none: all. transmissions: joints that the file has a transmission of, which may
            be some of those with motors.
    """

    model: pin.Model
    base: str = "fixed"
    mimics: tuple[Mimic, ...] = ()
    states: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    acceleration: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    source: str = ""
    undriven: tuple[str, ...] = ()
    geometry: Any = None
    loops: tuple[AnyLoop, ...] = ()
    actuated: tuple[str, ...] = ()
    transmissions: tuple[str, ...] = ()


def root_joint(base: str, library: Any = own) -> Any:
    """The joint of a base, by ``own`` or ``pin``, or None for a fixed one."""
    validation.one_of("base", base, BASES)
    if base == "fixed":
        return None
    return library.JointModelFreeFlyer() if base == "floating" else library.JointModelPlanar()


def own_base(model: pin.Model) -> str:
    """The base that a model has by itself: its only root joint is a free flyer or a planar joint."""
    roots = [j for j in range(1, model.njoints) if model.parents[j] == 0]
    return moving_freely(model, 1) if len(roots) == 1 else "fixed"


def moving_freely(model: pin.Model, j: int) -> str:
    """The base that a joint would be: ``floating``, ``planar``, or ``fixed`` for one that is none."""
    kind = model.joints[j].shortname()
    return {"JointModelFreeFlyer": "floating", "JointModelPlanar": "planar"}.get(kind, "fixed")


def with_base(model: pin.Model, base: str | None, q: Array | None = None) -> tuple[pin.Model, str]:
    """(model, base) with the wanted base joint put under a model that has none of its own.

    A model that brings a base and shall be ``fixed`` has it locked where ``q`` (default: ``pin.neutral``) puts it.

    Raises:
        UnknownNameError: no such base.
        RobotFileError: the model brings a base of another kind, or has several parts that move freely.
    """
    has = own_base(model)
    if base is None:
        return model, has
    joint = root_joint(base, algebra(model))
    if has != "fixed":
        if base == "fixed":
            return without_joints(model, [1], algebra(model).neutral(model) if q is None else q), base
        if base == has or (has == "planar" and base == "differential"):
            return model, base
        raise RobotFileError("base", base, f"the description has a {has} base of its own")
    if joint is None:
        return model, base
    for j in range(1, model.njoints):
        if model.parents[j] == 0 and moving_freely(model, j) != "fixed":
            reason = f"the joint {str(model.names[j])!r} at the root of the description moves freely already"
            raise RobotFileError("base", base, reason)
    return on_joint(model, joint, root_name(model.names)), base


def root_name(taken: Collection[str]) -> str:
    """A name for the joint of a base beside the joints of a description."""
    name = ROOT
    while name in taken:
        name += "_"
    return name


def finite_or_unlimited(array: Array) -> Array:
    """A copy where the "largest double" that some files use for none is infinity."""
    out = np.array(array, dtype=np.float64)
    out[np.abs(out) > 1e300] *= np.inf
    return out
