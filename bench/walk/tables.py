"""The tables of walks: courses, the highest speeds, turns."""

from __future__ import annotations

from bench.sheet import Sheet
from bench.walk.courses import binding, keeps
from bench.walk.machine import INCH, Record

#: Columns of a walk that was carried out
WALK = ("re-grasps", "plan, s", "real time with planning", "tick, us", "99 %", "body, mm", "hands, mm", "checker")


def course_sheet(records: list[Record]) -> Sheet:
    """Speeds that were asked for and that came out."""
    rows = [(r["course"], *_speed(r, "speed", INCH), *_walk(r), _lacks(r)) for r in records]
    columns = ("", "asked, in/s", "mean, in/s", "of it", *WALK, "what limits it")
    return Sheet("Courses of the source and their reverses", columns, rows)


def highest_sheet(records: list[Record]) -> Sheet:
    """Bisected speeds."""
    rows = [(r["course"], *_highest(r)) for r in records]
    return Sheet("Highest speeds that are kept", ("", "in/s", "re-grasps", "not kept", "what limits it there"), rows)


def spin_sheet(records: list[Record]) -> Sheet:
    """Turns, and the highest rate."""
    rows = []
    for r in records:
        name, lacks = r["course"], "" if "highest" in r else _lacks(r)
        if "highest" in r:
            name = f"{name}, as fast as it goes"
            lacks = f"kept up to {r['highest']:.3f} rad/s; at {r['above']:.3f}: {r['limit']}"
        rows.append((name, *_speed(r, "turn_rate", 1.0), *_walk(r), lacks))
    columns = ("", "asked, rad/s", "mean, rad/s", "of it", *WALK, "what limits it")
    return Sheet("Turning on the spot", columns, rows)


def _speed(r: Record, key: str, unit: float) -> tuple[str, str, str]:
    if key not in r:
        return f"{r['asked']:g}" if "asked" in r else "-", "-", "-"
    return f"{r['asked']:g}", f"{r[key] / unit:.3f}", f"{r['kept']:.3f}"


def _walk(r: Record) -> tuple[str, ...]:
    if "walk_s" not in r:
        spent = f"{r['plan_s']:.2f}" if "plan_s" in r else "-"
        return ("-", spent, *["-"] * 6)
    return (
        str(r["regrasps"]),
        f"{r['plan_s']:.2f}",
        f"{r['real_time_planned']:.1f}",
        f"{r['tick_us']:.0f}",
        f"{r['tick_p99_us']:.0f}",
        f"{r['body_mm']:.2f}",
        f"{r['slip_mm']:.3f}",
        "clean" if not r["violations"] else "; ".join(r["violations"]),
    )


def _highest(r: Record) -> tuple[str, ...]:
    regrasps = str(r["regrasps"]) if "regrasps" in r else "-"
    return f"{r['highest']:.2f}", regrasps, f"{r['above']:.2f}", r["limit"]


def _lacks(r: Record) -> str:
    return "" if keeps(r) else binding(r)
