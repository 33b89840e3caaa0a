"""Classical rate resolution on one drive."""

from __future__ import annotations

from bench.resolvers.drives import SECONDS, drive, methods
from bench.sheet import Sheet

COLUMNS = (
    "method",
    "one resolution [us]",
    "fastest joint [rad/s]",
    "twist lost [m/s, rad/s]",
    "after the return [rad]",
)


def parts() -> dict[str, Sheet | str]:
    """A row a method."""
    rows = []
    for name, make in methods().items():
        found = drive(name, make, SECONDS)
        first = f"failed: {found.failed}" if found.failed else f"{found.microseconds:.0f}"
        away = "" if found.failed else f"{found.away:.2g}"
        rows.append((found.name, first, f"{found.fastest:.3g}", f"{found.lost:.2g}", away))
    return {"drive": Sheet("", COLUMNS, rows)}
