"""Units that rows of items can have, and how they are measured by the characteristic length."""

from __future__ import annotations

import math
from typing import Any

from wbc.errors import UnknownNameError

#: Unit of a row -> (how many of it are one in SI units, power of the characteristic length that it is measured by);
#: rows of momenta are not measured by a length, since no mass is the characteristic one; rows of forces say their own
#: size, see :attr:`wbc.tasks.base.Row.size`
UNITS: dict[str, tuple[float, int]] = {
    "m": (1.0, 1),
    "cm": (1e2, 1),
    "mm": (1e3, 1),
    "in": (1.0 / 0.0254, 1),
    "m^2": (1.0, 2),
    "rad": (1.0, 0),
    "mrad": (1e3, 0),
    "deg": (180.0 / math.pi, 0),
    "1": (1.0, 0),
    "": (1.0, 0),
    "%": (1e2, 0),
    "kg m": (1.0, 0),
    "kg m^2": (1.0, 0),
    "N": (1.0, 0),
    "N m": (1.0, 0),
}


def checked_unit(field: str, unit: Any) -> str:
    """A unit that rows can have.

    Raises:
        UnknownNameError: it is not, with the list.
    """
    if not isinstance(unit, str) or unit.removesuffix("/s") not in UNITS:
        raise UnknownNameError(field, unit, (known for known in UNITS if known))
    return unit
