"""Ways round, where the body cannot follow its path as it is: higher and lower and turned, then beside it too."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

from wbc.robots import Walker
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.planner.detours import ALONG, WIDE, BodyRoute, find_route

#: Cells that are looked at, in the order of trying
MESHES = (ALONG, WIDE)


def ways_round(
    walker: Walker,
    structure: Structure,
    path: BodyPath,
    start: Mapping[int, int] | None = None,
    deadline: float | None = None,
) -> Iterator[BodyRoute]:
    """Routes from a path's beginning to its end, those near the path first; the next one is looked for when asked for.

    Args:
        start: arm -> hold (rows) of hands that hold at the beginning. deadline: of ``time.perf_counter``.
    """
    for mesh in MESHES:
        if deadline is not None and time.perf_counter() > deadline:
            return
        yield find_route(walker, structure, path, mesh=mesh, start=start, deadline=deadline)
