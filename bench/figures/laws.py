"""Tables of the laws of motion, as docs/trajectory.md shows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bench.figures import store


def table(number: int) -> Callable[[Any], str]:
    """A table of bench/time_laws.json under its title."""

    def view(data: Any) -> str:
        found = data["tables"][number]
        return f"**{found['title']}**\n\n{store.shown(found)}"

    return view


VIEWS: Mapping[str, Callable[[Any], str]] = {
    "random": table(0), "small": table(1), "suite": table(2), "torques": table(3), "states": table(4),
    "straight": table(5), "walls": table(6), "ticks": table(7), "along": table(8),
}  # fmt: skip
