"""The published arm, its task and its controllers, and today's beside them; what the linearised controller costs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from bench.sheet import Sheet
from wbc.motion_control.comparison import Condition, compare
from wbc.published.newton_euler import (
    Adaptive,
    DecoupledArm,
    DecoupledTwo,
    Drive,
    Linearised,
    Nominal,
    discretised,
    gain,
    rigid,
    simulate,
)
from wbc.published.newton_euler.comparison import published_scenario
from wbc.published.newton_euler.control import Controller
from wbc.published.newton_euler.counts import operations
from wbc.published.newton_euler.simulation import PLANTS
from wbc.published.newton_euler.three_link import MOTOR, arm, task, tip


def parts() -> dict[str, Sheet | str]:
    """Tracking on the three plants; with a payload; with noise and heavier links; cost of a step."""
    return {"tracking": _tracking(), "payload": _payload(), "faults": _faults(), "cost": _cost()}


def _tracking() -> Sheet:
    chosen, motion, drive, rows = arm(), task(), Drive([MOTOR] * 3), []
    laws: dict[str, Callable[[], Controller]] = {
        "nominal torque": lambda: Nominal(chosen, motion),
        "1 linearised": lambda: Linearised(chosen, motion, 0.01),
        "2 decoupled": lambda: DecoupledTwo(motion, 0.01),
        "2 on all joints": lambda: DecoupledArm(rigid(chosen.model), motion, 0.01),
        "3 adaptive": lambda: Adaptive(chosen, motion, 0.01),
    }
    scenario = published_scenario()
    for name in ("1 with stiff weights", "computed torque", "adaptive, last link", "one-step optimum", "torque stack"):
        maker = scenario.controllers[name]
        laws[name] = lambda maker=maker: maker(scenario.robot, motion, 0.01)
    for name, make in laws.items():
        cells = [name]
        for plant in PLANTS:
            run = simulate(chosen.model, make(), motion, plant=plant, drive=drive)
            off = max(np.linalg.norm(tip(q) - tip(motion(t)[0])) for q, t in zip(run.q, run.times, strict=True))
            cells.append(f"{1e3 * off:.3g}")
            if plant == "torque":
                more = [f"{error:.2g}" for error in run.largest] + [
                    f"{u:.3g}" if u > 1e-9 else "0" for u in run.perturbation
                ]
        rows.append((*cells, *more))
    heads = ("controller", "listing [mm]", "torque [mm]", "motor [mm]", "joint 1 [rad]", "joint 2 [rad]", "joint 3 [m]",
             "u1 [N m]", "u2 [N m]", "u3 [N]")  # fmt: skip
    return Sheet("", heads, rows)


def _payload() -> Sheet:
    rows, scenario = [], published_scenario()
    slow, fast = (list(compare(scenario, Condition(scenario.payload, rate=rate))) for rate in (100.0, 1000.0))
    for one, other in zip(slow, fast, strict=True):
        cells = [one.name]
        for found in (one, other):
            off = (found.largest, found.residual)
            cells += ["ran away", ""] if found.trial.away else [f"{1e3 * distance:.3g}" for distance in off]
        mass = "" if other.mass is None else f"{other.mass[0]:.3f} +- {other.mass[1]:.3f}"
        rows.append((*cells, f"{other.microseconds:.0f}", mass))
    heads = ("controller", "100 Hz [mm]", "at the end [mm]", "1 kHz [mm]", "at the end [mm]", "a command [us]",
             "payload learned [kg]")  # fmt: skip
    return Sheet("", heads, rows)


def _faults() -> Sheet:
    """Largest distance of the tip [mm]; no payload."""
    columns, scenario = [], published_scenario()
    for fault in ({"noise": 1e-5}, {"heavier": 1.2}):
        for rate in (100.0, 1000.0):
            found = compare(scenario, Condition(**fault, rate=rate))
            columns.append(["ran away" if one.trial.away else f"{1e3 * one.largest:.3g}" for one in found])
    heads = ("controller", "noise, 100 Hz [mm]", "noise, 1 kHz [mm]", "heavier, 100 Hz [mm]", "heavier, 1 kHz [mm]")
    return Sheet("", heads, list(zip(scenario.names(), *columns, strict=True)))


def _cost() -> Sheet:
    """One step of controller 1 with Pinocchio's derivatives, beside the operations that the thesis counts."""
    rows = []
    for n in (3, 6, 7):
        model = pin.Model()
        rng = np.random.default_rng(n)
        for i in range(n):
            joint = pin.JointModelRevoluteUnaligned(*np.eye(3)[i % 3])
            place = pin.SE3(np.eye(3), rng.normal(size=3) * 0.3)
            model.appendBodyToJoint(
                model.addJoint(i, joint, place, f"j{i}"), pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity()
            )
        data, Q, R = model.createData(), 1e5 * np.eye(2 * n), 0.01 * np.eye(n)
        q, v, a = rng.normal(size=(3, n))
        spent = []
        for _ in range(300):
            start = time.perf_counter()
            by_q, by_v, M = pin.computeRNEADerivatives(model, data, q, v, a)
            H = np.triu(M) + np.triu(M, 1).T
            inverse, zero = np.linalg.inv(H), np.zeros((n, n))
            A = np.block([[zero, np.eye(n)], [-inverse @ by_q, -inverse @ by_v]])
            Phi, E = discretised(A, 1e-3)
            _ = data.tau - gain(Phi, E[:, n:] @ inverse, Q, R) @ np.concatenate([q, v])
            spent.append(time.perf_counter() - start)
        counts = [f"{number}" for name in ("linearised", "adaptive") for number in operations(name, n)]
        rows.append((f"{n}", *counts, f"{1e6 * float(np.median(spent)):.0f}"))
    heads = (
        "links",
        "controller 1: x, /",
        "+, -",
        "controller 3: x, /",
        "+, -",
        "controller 1, today [us]",
    )
    return Sheet("", heads, rows)
