"""The error hierarchy: every error that this package raises on purpose is a :class:`WbcError`.

An error names the *field* that was wrong, the *value* that was given and, where the choice is
from a list, the valid *choices* with the nearest one first. Raising leaves every object as it was.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterable
from typing import Any


class WbcError(Exception):
    """Root of all errors of this package.

    Attributes:
        field: what was wrong, as the caller spells it (``"q"``, ``"hand.target"``).
        value: the value that was given.
        reason: why it was refused, without field and value.
        choices: the valid values, nearest first; empty where there is no list to choose from.
    """

    def __init__(self, field: str, value: Any, reason: str, choices: Iterable[str] = ()) -> None:
        self.field = field
        self.value = value
        self.reason = reason
        self.choices = tuple(choices)
        text = f"{field}: {reason} (got {_short(value)})"
        if self.choices:
            shown = ", ".join(self.choices[:8])
            more = f", ... {len(self.choices) - 8} more" if len(self.choices) > 8 else ""
            text += f"; valid: {shown}{more}"
        super().__init__(text)

    def within(self, name: str) -> WbcError:
        """The same error about ``name.field``."""
        return _rebuilt(type(self), (f"{name}.{self}",), {**self.__dict__, "field": f"{name}.{self.field}"})

    def about(self, what: str) -> WbcError:
        """The same error with a text that begins with what it is about."""
        return _rebuilt(type(self), (f"{what}: {self}",), self.__dict__)

    def __reduce__(self) -> tuple[Any, ...]:
        # Exceptions are rebuilt from their text alone, which no constructor here takes: they must cross processes
        return _rebuilt, (type(self), self.args, self.__dict__)


class UnknownNameError(WbcError):
    """A frame, joint, item, robot, solver or option name that does not exist."""

    def __init__(self, field: str, value: Any, choices: Iterable[str]) -> None:
        ranked = nearest(str(value), choices)
        hint = f"unknown name, did you mean {ranked[0]!r}?" if ranked else "unknown name"
        super().__init__(field, value, hint, ranked)


class UnknownAttributeError(UnknownNameError, AttributeError):
    """A run-time value, or another attribute, that an object does not have."""


class FixedAttributeError(WbcError, AttributeError):
    """An attribute that cannot be set."""


class DuplicateNameError(WbcError):
    """A name that is taken already."""


class ShapeError(WbcError):
    """An array of the wrong shape or an object of the wrong type."""


class NotFiniteError(WbcError):
    """NaN or infinity where a finite number is needed."""


class RangeError(WbcError):
    """A number outside its valid range (negative weight, dt <= 0, rate * dt > 1)."""


class BoundsError(WbcError):
    """Lower bounds above upper bounds."""


class RotationError(WbcError):
    """A quaternion that is not of unit length, or a matrix that is not a rotation."""


class RobotFileError(WbcError):
    """A robot description that cannot be read or parsed."""


class UnsupportedJointError(WbcError):
    """A joint type that the symbolic kinematics do not cover."""


class MissingShapeError(WbcError):
    """A link without collision shapes where some are needed."""


class LevelError(WbcError):
    """A level that an item cannot have, or levels where there can be none; a level is never turned into a weight."""


class CommandError(WbcError):
    """An item, a solver or a value that has no meaning for what a stack is compiled to command."""


class SolverError(WbcError):
    """A solver that is missing or that failed outside of a tick."""


class PicklingError(WbcError, pickle.PicklingError):
    """Something that cannot be pickled, or a pickle that does not fit."""


class BusyError(WbcError):
    """A controller that two threads use at once."""


class ContinuityError(WbcError):
    """Motions that do not meet, or a path that breaks; ``value`` says where or by how much."""


class InfeasibleError(WbcError):
    """No motion keeps what is asked for; ``value`` is what was asked."""


class LawFileError(WbcError):
    """A file that holds no law of motion, or a law that no file can hold."""


class StructureFileError(WbcError):
    """A file that describes no structure to walk on; ``field`` names the line and the column."""


class ClipFileError(WbcError):
    """A file that holds no clip of motion, or one that cannot be read."""


class CompileError(WbcError):
    """The C compiler was asked for and could not build the tick."""


def nearest(name: str, choices: Iterable[str]) -> tuple[str, ...]:
    """All choices, the most similar to ``name`` first."""
    # Imported for a mistake only
    import difflib

    lowered = name.lower()

    def distance(choice: str) -> tuple[float, str]:
        ratio = difflib.SequenceMatcher(None, lowered, choice.lower()).ratio()
        return (-ratio, choice)

    return tuple(sorted(set(choices), key=distance))


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def _rebuilt(kind: type[WbcError], arguments: tuple[Any, ...], attributes: dict[str, Any]) -> WbcError:
    error = kind.__new__(kind, *arguments)
    error.__dict__.update(attributes)
    return error
