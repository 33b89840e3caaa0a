"""The tables of walks: courses, the highest speeds, turns, trenches; and what is asked of them."""

from __future__ import annotations

from textwrap import shorten

from bench.goals import Goal
from bench.sheet import Sheet
from bench.walk.courses import RATE, SPEED, binding, keeps
from bench.walk.machine import INCH, Record
from bench.walk.trenches import LEAST, crossed

#: Columns of a walk that was carried out
WALK = ("re-grasps", "plan, s", "real time with planning", "tick, us", "99 %", "body, mm", "hands, mm", "checker")
#: Letters of a refusal that a table has room for
WHY = 160


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


def trench_sheet(records: list[Record]) -> Sheet:
    """Reference, and what came out; of a refusal the beginning of its reason."""
    rows = []
    for r in records:
        done = "yes" if crossed(r) else "refused" if not r["planned"] else "no"
        fast = f"{r['progress'] / INCH:.2f}" if "progress" in r else "-"
        took = f"{r['walk_s']:.0f}" if "walk_s" in r else "-"
        why = shorten(r["reason"], WHY, placeholder=" ...")
        rows.append((r["trench"], r["verdict"], done, took, fast, *_walk(r), why))
    columns = ("", "reference", "crossed", "s", "in/s", *WALK, "why not")
    return Sheet("Trenches; the body may go from 44 to 54 in, turn and go round", columns, rows)


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


def trench_goals(records: list[Record]) -> list[Goal]:
    """Four and five rows; every walk is sound, every refusal names holds."""
    wanted = [r for r in records if r["trench"] in ("4 rows", "5 rows")]
    bad = sum(bool(r.get("violations")) or (r["planned"] and not r.get("arrived")) for r in records)
    mute = sum(not r["planned"] and not r["separating"] for r in records)
    return [
        Goal(f"trenches of 4 and 5 rows not crossed at {LEAST:g} in/s", sum(not crossed(r) for r in wanted), 0, ""),
        Goal("trenches that are planned and then not walked as the checker wants it", bad, 0, ""),
        Goal("trenches that are refused without separating holds", mute, 0, ""),
    ]


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
    return r.get("swing_limit", "") if keeps(r) else binding(r)
