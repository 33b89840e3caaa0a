"""The least time of plans, and what the reference search says of trenches."""

from __future__ import annotations

from time import process_time

import wbc.robots
from bench.sheet import Sheet
from bench.walk.reference import GridPose, Reference
from wbc.walking import cylinder, remove_rows
from wbc.walking.body_path import grid_path
from wbc.walking.planner import plan_walk
from wbc.walking.planner.plan_time import least_plan_time

INCH = 0.0254
#: Heights of the body that the reference may take [in]
HEIGHTS = {"52 in": (52,), "46 to 54 in": (46, 49, 52, 54), "44 to 54 in": (44, 46, 49, 52, 54)}
ROWS = {3: "12-14", 4: "11-14", 5: "11-15", 6: "10-15", 7: "10-16", 8: "9-16"}


def parts() -> dict[str, Sheet | str]:
    """Two tables."""
    return {"least": least_times(), "rows": rows()}


def least_times() -> Sheet:
    """Along the cylinder from (13, 6) to (13, 18)."""
    walker, structure = wbc.robots.walker(), cylinder(rigid=True)
    out = []
    for speed in (2, 4, 6):
        plan = plan_walk(walker, structure, grid_path([(13, 6), (13, 18)], speed=speed * INCH))
        found = least_plan_time(walker, plan)
        joint = max(found.binding, key=lambda name: found.binding[name])
        out.append((f"{speed} in/s", f"{found.planned:.2f} s", f"{found.least:.2f} s",
                    f"{joint}, {100 * found.binding[joint]:.0f} % of the time"))  # fmt: skip
    return Sheet("", ("speed", "plan", "least time", "binds longest"), out)


def judged(reference: Reference, *case: object) -> str:
    """A verdict with what it took."""
    began = process_time()
    verdict = reference.judge(*case)  # type: ignore[arg-type]
    steps = f", {verdict.regrasps} re-grasps" if verdict.kind == "possible" else ""
    return f"{verdict.kind}{steps}, {process_time() - began:.2f} s"


def rows() -> Sheet:
    """The body from (13, 5) to (13, 20), any heading at both ends, some rows between them removed."""
    start, goal, whole = GridPose(13, 5, None), GridPose(13, 20, None), cylinder()
    machines = {name: Reference(heights=tuple(inch * INCH for inch in some)) for name, some in HEIGHTS.items()}
    for reference in machines.values():
        reference.judge(whole, start, goal)  # makes the tables
    out = [
        (
            f"{count} ({span})",
            *(judged(reference, remove_rows(whole, span), start, goal) for reference in machines.values()),
        )
        for count, span in ROWS.items()
    ]
    return Sheet("", ("rows removed", *HEIGHTS), out)
