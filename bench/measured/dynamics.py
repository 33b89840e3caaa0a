"""The published arm, its task and its controllers, and today's beside them; what the linearised controller costs."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from bench.sheet import Sheet
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
from wbc.published.newton_euler.comparison import LAWS, compare
from wbc.published.newton_euler.control import Controller
from wbc.published.newton_euler.counts import operations
from wbc.published.newton_euler.simulation import PLANTS
from wbc.published.newton_euler.three_link import MOTOR, arm, task, tip

#: Half the mass of the last link [kg]
PAYLOAD = 2.125


def parts() -> dict[str, Sheet | str]:
    """Tracking on the three plants; with a payload; cost of a step."""
    return {"tracking": _tracking(), "payload": _payload(), "cost": _cost()}


def _tracking() -> Sheet:
    chosen, motion, drive, rows = arm(), task(), Drive([MOTOR] * 3), []
    laws: dict[str, Callable[[], Controller]] = {
        "nominal torque": lambda: Nominal(chosen, motion),
        "1 linearised": lambda: Linearised(chosen, motion, 0.01),
        "2 decoupled": lambda: DecoupledTwo(motion, 0.01),
        "2 on all joints": lambda: DecoupledArm(rigid(chosen.model), motion, 0.01),
        "3 adaptive": lambda: Adaptive(chosen, motion, 0.01),
        "1 with stiff weights": lambda: LAWS["1 with stiff weights"](0.01),
        "computed torque": lambda: LAWS["computed torque"](0.01),
    }
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
    rows = []
    slow, fast = (list(compare(PAYLOAD, dt)) for dt in (0.01, 0.001))
    for one, other in zip(slow, fast, strict=True):
        cells = [one.name]
        for found in (one, other):
            cells += [f"{1e3 * off:.3g}" for off in (found.tip.max(), found.tip[-1])] if found.run else ["ran away", ""]
        cells += [f"{other.microseconds:.0f}", "" if other.mass is None else f"{other.mass:.3f}"]
        rows.append(tuple(cells))
    heads = ("controller", "100 Hz [mm]", "at the end [mm]", "1 kHz [mm]", "at the end [mm]", "a command [us]",
             "payload learned [kg]")  # fmt: skip
    return Sheet("", heads, rows)


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
