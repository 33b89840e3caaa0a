"""Rows of a Jacobian as declarations: which body, relative to what, seen from where, which components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from wbc import validation
from wbc.analysis.kept_hash import keeps_hash
from wbc.errors import RangeError, ShapeError
from wbc.symbolic.kinematics import WORLD

ALL = (0, 1, 2)


@keeps_hash
@dataclass(frozen=True)
class BodyRows:
    """Components of a frame's velocity (v; omega) relative to a body.

    Attributes:
        frame: whose origin and whose body. base: relative to the body that carries this frame.
        expressed: axes of the components; None: the cheapest, allowed where all three of a kind are taken.
        translation, rotation: components of v and of omega, from 0.
        name: how reports call the rows.
    """

    frame: str
    base: str = WORLD
    expressed: str | None = None
    translation: tuple[int, ...] = ALL
    rotation: tuple[int, ...] = ALL
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for kind in ("translation", "rotation"):
            chosen = validation.items(f"rows.{kind}", getattr(self, kind), "components")
            whole = all(isinstance(k, int | np.integer) and not isinstance(k, bool) for k in chosen)
            if not whole or sorted(set(chosen)) != sorted(chosen) or not set(chosen) <= set(ALL):
                raise RangeError(f"rows.{kind}", chosen, "expected different numbers among 0, 1, 2")
            if self.expressed is None and len(chosen) not in (0, 3):
                raise RangeError(f"rows.{kind}", chosen, "a part of the components needs `expressed`, a frame")
        if not self.translation and not self.rotation:
            raise RangeError("rows", self.frame, "no component is chosen")

    def __str__(self) -> str:
        return self.name or self.frame


@keeps_hash
@dataclass(frozen=True)
class JointRows:
    """The rate of a joint: a row of the identity. With zero command the joint is locked.

    Attributes:
        joint: its name.
    """

    joint: str
    name: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.name or self.joint


@keeps_hash
@dataclass(frozen=True)
class PitchPlaneRows:
    """Rate of the pitch plane about the common normal r of two parallel pitch axes, without its factor 1/|r|:

        r = (w - s) - y (y.(w - s)),    row = r.omega

    s, w: origins of the frames; y, omega: axis and angular velocity of the joint that carries ``shoulder``. The factor
    is positive, so it changes no rank; where r = 0 the rate is undefined and this row is zero.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, eqs. 4.5 to 4.7.

    Attributes:
        shoulder, wrist: frames at the two pitch joints.
    """

    shoulder: str
    wrist: str
    name: str = field(default="alpha", compare=False)

    def __str__(self) -> str:
        return self.name


Rows: TypeAlias = BodyRows | JointRows | PitchPlaneRows


def checked(field_name: str, rows: object) -> tuple[Rows, ...]:
    """Declarations as a tuple.

    Raises:
        ShapeError: something else than a sequence of declarations, or an empty one.
    """
    found = tuple(rows) if isinstance(rows, Sequence) and not isinstance(rows, str | bytes) else (rows,)
    if not found or not all(isinstance(r, (BodyRows, JointRows, PitchPlaneRows)) for r in found):
        raise ShapeError(field_name, rows, "expected BodyRows, JointRows or PitchPlaneRows, at least one")
    return found
