"""The tables of walks: courses, the highest speeds, turns; and what is asked of them."""

from __future__ import annotations

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.courses import RATE, SPEED, binding, keeps
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


def course_goals(records: list[Record]) -> list[Goal]:
    """0.98 of 6 in/s everywhere, in time, and nothing that the checker finds."""
    slow = sum(not keeps(r) for r in records)
    out = [Goal(f"courses of {len(records)} on which 0.98 of {SPEED:g} in/s is not kept", slow, 0, "")]
    done = [r for r in records if r.get("arrived")]
    if done:
        out += [
            Goal("body off its command", max(r["body_mm"] for r in done), 2.0, "mm"),
            Goal("hands off their holds", max(r["slip_mm"] for r in done), 2.0, "mm"),
            Goal("99 % of ticks, by the clock", max(r["tick_p99_us"] for r in done), 2000.0, "us"),
            Goal("99 % of the loop, processor time", max(r["loop_p99_us"] for r in done), 2000.0, "us"),
            Goal("one over real time, with planning", max(1 / r["real_time_planned"] for r in done), 0.05, ""),
        ]
    return out


def spin_goals(records: list[Record]) -> list[Goal]:
    """Three turns at the usual rate."""
    asked = [r for r in records if "highest" not in r]
    return (
        [Goal(f"turns at {RATE:g} rad/s that are not kept", sum(not keeps(r) for r in asked), 0, "")] if asked else []
    )


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
