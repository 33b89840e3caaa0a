"""Controllers of torques on one motion of a UR5, published ones beside today's."""

from __future__ import annotations

from bench.sheet import Sheet
from wbc.motion_control.comparison import ComparisonRow, compare, standard_conditions
from wbc.published.newton_euler.comparison import scenario_with_published
from wbc.robots import load


def parts() -> dict[str, Sheet | str]:
    """Largest distances, at the end, cost of a command."""
    return {"arm": _arm()}


def _off(one: ComparisonRow) -> str:
    return "ran away" if one.trial.away else f"{1e3 * one.largest:.3g}; {1e3 * one.residual:.2g}"


def _arm() -> Sheet:
    """A UR5 that swings for 2 s, at 1 kHz."""
    scenario = scenario_with_published(load("ur5"))
    conditions = [condition for condition in standard_conditions(scenario.payload) if condition.rate == 1000.0]
    columns = [list(compare(scenario, condition)) for condition in conditions]
    rows = []
    for k, name in enumerate(scenario.names()):
        mass = columns[1][k].mass
        known = mass is not None and mass[1] < 0.1
        learned = f"{mass[0]:.3f} +- {mass[1]:.3f}" if known and mass else "not shown" if mass else ""
        rows.append((name, *(_off(column[k]) for column in columns), f"{columns[0][k].microseconds:.0f}", learned))
    said = (str(condition).removesuffix(", 1000 Hz") for condition in conditions)
    return Sheet("", ("controller", *(f"{text} [mm]" for text in said), "a command [us]", "payload learned [kg]"), rows)
