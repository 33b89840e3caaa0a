"""Poses, inertias, trees of joints and their numbers.

``own`` is what this package has itself: robots are read, declared and solved with it. ``pin`` is Pinocchio, imported
when a name of it is first asked for; where it is not installed, ``pin`` is ``own``. Both have the same names,
conventions and order of coordinates.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import sys
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import own
from wbc.multibody.model import OF_COORDINATES, OF_DOFS

if TYPE_CHECKING:
    import pinocchio as pin

#: Whether Pinocchio is installed
PINOCCHIO = importlib.util.find_spec("pinocchio") is not None

T = TypeVar("T")

#: What ends the key of a converted attribute among an object's
CONVERTED = " in Pinocchio"
#: Components of an axis this much apart are the same
_ALIGNED = 1e-15
#: Functions (model, ...) of Pinocchio that give a Jacobian, of one degree of freedom without its second dimension
_JACOBIANS = (
    "computeFrameJacobian", "getFrameJacobian", "computeJointJacobians", "getJointJacobian", "jacobianCenterOfMass",
)  # fmt: skip
#: The least URDF with a continuous joint of an axis
_ENDLESS = (
    '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
    '<parent link="a"/><child link="b"/><axis xyz="{} {} {}"/></joint></robot>'
)


class _AtFirstUse(ModuleType):
    """Pinocchio's names, once one of them is asked for."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__version__":
            raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}", name=name, obj=self)
        chosen = importlib.import_module("pinocchio") if PINOCCHIO else own
        # From here on a name costs what it costs of a module
        vars(self).update({key: value for key, value in vars(chosen).items() if not key.startswith("__")})
        vars(self).update({key: _in_two_dimensions(getattr(chosen, key)) for key in _JACOBIANS})
        return vars(self)[name] if name in _JACOBIANS else getattr(chosen, name)


def _in_two_dimensions(jacobian: Callable[..., NDArray[np.float64]]) -> Callable[..., NDArray[np.float64]]:
    @functools.wraps(jacobian)
    def of(*given: Any) -> NDArray[np.float64]:
        out = jacobian(*given)
        return out if out.ndim == 2 else out.reshape(-1, 1)

    return of


if not TYPE_CHECKING:
    pin = _AtFirstUse("pin")


def __getattr__(name: str) -> Any:
    if name == "SE3":
        return pin.SE3
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def algebra(model: Any) -> Any:
    """The module whose functions take a model: ``own`` for one of this package's, else Pinocchio."""
    return own if isinstance(model, own.Model) else pin


def mass_matrix(model: Any, data: Any, q: Any) -> NDArray[np.float64]:
    """M(q) [nv, nv]; Pinocchio fills its upper half alone."""
    upper = np.triu(algebra(model).crba(model, data, q))
    return np.asarray(upper + np.triu(upper, 1).T)


def _is(value: Any, kind: str) -> bool:
    """Whether a value is an ``own`` one of a class, or Pinocchio's, which is not imported to see it."""
    theirs = getattr(sys.modules.get("pinocchio"), kind, None)
    return isinstance(value, getattr(own, kind)) or (theirs is not None and isinstance(value, theirs))


def is_pose(value: Any) -> bool:
    """Whether a value is an ``SE3`` of either."""
    return _is(value, "SE3")


def is_model(value: Any) -> bool:
    """Whether a value is a ``Model`` of either."""
    return _is(value, "Model")


def to_pin(value: Any) -> Any:
    """A pose or model of this package's as Pinocchio's, with the same numbers; where it is not installed, and anything
    else, as it is.
    """
    if PINOCCHIO and isinstance(value, own.SE3):
        return pin.SE3(value.rotation, value.translation)
    return _pinocchio_model(value) if PINOCCHIO and isinstance(value, own.Model) else value


def _pinocchio_model(model: own.Model) -> pin.Model:
    out = pin.Model()
    for j in range(1, model.njoints):
        out.addJoint(
            model.parents[j], _pinocchio_joint(model.joints[j]), to_pin(model.jointPlacements[j]), model.names[j]
        )
    for j, inertia in enumerate(model.inertias):
        out.inertias[j] = _pinocchio_inertia(inertia)
    for frame in model.frames[1:]:
        inertia = _pinocchio_inertia(frame.inertia)
        kind, above = pin.FrameType.values[int(frame.type)], frame.parentFrame
        out.addFrame(pin.Frame(frame.name, frame.parentJoint, above, to_pin(frame.placement), kind, inertia), False)
    out.frames[0].placement = to_pin(model.frames[0].placement)
    for key in (*OF_DOFS, *OF_COORDINATES):
        setattr(out, key, getattr(model, key).copy())
    for key, values in model.referenceConfigurations.items():
        out.referenceConfigurations[key] = values.copy()
    out.name, out.gravity = model.name, pin.Motion(model.gravity.vector)
    return out


def _pinocchio_joint(joint: own.JointModel) -> pin.JointModel:
    kind = joint.shortname()
    if kind == "JointModelRevoluteUnboundedUnaligned":
        # Python has no constructor of it that takes an axis
        return pin.buildModelFromXML(_ENDLESS.format(*(repr(float(x)) for x in joint.axis))).joints[1]
    return getattr(pin, kind)(joint.axis) if kind.endswith("Unaligned") else getattr(pin, kind)()


def _pinocchio_inertia(inertia: own.Inertia) -> pin.Inertia:
    # Pinocchio's constructor refuses moments that no body has, which files do have
    out = pin.Inertia.Zero()
    out.mass, out.lever, out.inertia = inertia.mass, inertia.lever, inertia.inertia
    return out


def in_pinocchio(name: str) -> Callable[[type[T]], type[T]]:
    """Of a dataclass the attribute that is handed out as Pinocchio's, converted when it is first read.

    What was given is in ``vars(thing)[name]``.
    """

    def decorate(kind: type[T]) -> type[T]:
        setattr(kind, name, _Converted(name))
        return kind

    return decorate


class _Converted:
    def __init__(self, name: str) -> None:
        self._name, self._converted = name, name + CONVERTED

    def __get__(self, thing: object, owner: type) -> Any:
        if thing is None:
            return self
        known = vars(thing)
        if self._converted not in known:
            known[self._converted] = to_pin(known[self._name])
        return known[self._converted]

    def __set__(self, thing: object, value: Any) -> None:
        vars(thing).pop(self._converted, None)
        vars(thing)[self._name] = value


def single_joint(
    axis: NDArray[np.float64], *, slides: bool = False, endless: bool = False, library: Any = own
) -> own.JointModel:
    """The joint that turns about, or slides along, a unit vector; one that knows its axis where it can.

    Args:
        axis: the vector. slides: along it. endless: turns about it with (cos, sin) as coordinates.
        library: whose joint, ``own`` or ``pin``; an endless one is ``own``.
    """
    kinds = ("JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned")
    if slides:
        kinds = ("JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned")
    elif endless:
        kinds = ("JointModelRUBX", "JointModelRUBY", "JointModelRUBZ", "JointModelRevoluteUnboundedUnaligned")
    along = np.flatnonzero(np.abs(axis - np.eye(3)).max(axis=1) < _ALIGNED)
    joint: own.JointModel = getattr(library, kinds[along[0]])() if along.size else getattr(library, kinds[3])(axis)
    return joint


__all__ = [
    "CONVERTED", "PINOCCHIO", "SE3", "algebra", "in_pinocchio", "is_model", "is_pose", "own", "pin", "single_joint",
    "to_pin",
]  # fmt: skip
