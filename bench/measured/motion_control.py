"""Controllers of torques on one motion of a UR5 and of a free-floating one; a humanoid and a quadruped in MuJoCo."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from tempfile import TemporaryDirectory

import numpy as np

from bench.pool import ROOT
from bench.sheet import Sheet
from wbc.motion_control.comparison import Compared, Condition, Scenario, compare, scenario_of, standard_conditions
from wbc.robots import load


def parts() -> dict[str, Sheet | str]:
    """Largest distances, at the end, cost of a command; a payload in free fall; both examples."""
    return {
        "arm": _arm(),
        "free": _free(),
        "humanoid": f"```text\n{said('mujoco_humanoid')}\n```",
        "quadruped": f"```text\n{said('mujoco_quadruped')}\n```",
    }


def said(name: str) -> str:
    """What an example prints in a folder of its own, without the name of its picture."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, str(ROOT / "examples" / f"{name}.py")]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    return "\n".join(line for line in done.stdout.splitlines() if not line.endswith(".png"))


def _off(one: Compared) -> str:
    return "ran away" if one.trial.away else f"{1e3 * one.largest:.3g}; {1e3 * one.residual:.2g}"


def _arm() -> Sheet:
    """A UR5 that swings for 2 s."""
    scenario = scenario_of(load("ur5"))
    conditions = standard_conditions(scenario.payload)
    columns = [list(compare(scenario, condition)) for condition in conditions]
    rows = []
    for k, name in enumerate(scenario.names()):
        mass = columns[3][k].mass
        known = mass is not None and mass[1] < 0.1
        learned = f"{mass[0]:.3f} +- {mass[1]:.3f}" if known and mass else "not shown" if mass else ""
        rows.append((name, *(_off(column[k]) for column in columns), f"{columns[1][k].microseconds:.0f}", learned))
    heads = ("controller", *(f"{condition} [mm]" for condition in conditions), "a command [us]", "payload learned [kg]")
    return Sheet("", heads, rows)


def _free() -> Sheet:
    """3 kg that nobody knows of in the hand of a UR5 without gravity, at 1 kHz; its base fixed, and floating."""
    rows = []
    for base in ("fixed", "floating"):
        robot = load("ur5", base=base)
        model = robot.model.copy()
        model.gravity.linear = np.zeros(3)
        scenario = scenario_of(replace(robot, model=model), 4.0)
        chosen = [name for name in scenario.names() if name in ("computed torque", "adaptive, last link")]
        rows += [_row(base, one) for one in compare(scenario, Condition(3.0, rate=1000.0), chosen)]
        rows += [("", f"the same, 10 times slower ({base})", "", "", _slow(scenario))]
    heads = ("base", "controller", "largest [mm]", "over the last tenth [mm]", "payload learned [kg]")
    return Sheet("", heads, rows)


def _row(base: str, one: Compared) -> tuple[str, ...]:
    mass = "" if one.mass is None else f"{one.mass[0]:.3f} +- {one.mass[1]:.3f}"
    return base, one.name, f"{1e3 * one.largest:.3g}", f"{1e3 * one.residual:.2g}", mass


def _slow(scenario: Scenario) -> str:
    def motion(t: float):  # type: ignore[no-untyped-def]
        q, v, a = scenario.motion(0.1 * t)
        return q, 0.1 * v, 0.01 * a

    slow = replace(scenario, motion=motion)
    (one,) = compare(slow, Condition(3.0, rate=1000.0), ["adaptive, last link"])
    return "" if one.mass is None else f"not shown: +- {one.mass[1]:.2g}"
