"""Whether contacts bear the robot: as logged under torques, else whether they can at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wbc.climb.checker.record import OPEN, Climbed
from wbc.climb.checker.report import CheckRules, RuleTally
from wbc.linear_program import OPTIMAL, least
from wbc.multibody import pin
from wbc.validation import Array

#: Least singular value, of rows in metres and radians, with which contacts keep a weightless body where it is
FIXES = 1e-4
#: Standard gravity, by which a mass is a force wherever it is [m/s^2]
STANDARD = 9.80665
#: Largest slack that is asked for, in weights: cones that hold more are all the same
ENOUGH = 10.0
#: Rows of cones that differ by less are the same
SAME_ROW = 1e-12


def check_cones(climbed: Climbed, rules: CheckRules, tally: RuleTally) -> None:
    """Under gravity g, at every ``rules.every`` and at every change of contacts, the largest t with which wrenches w_k
    exist that hold the robot at rest:

        sum_k X_k w_k = (-m g; c x -m g),     A_k w_k + t m |g| n_k <= b_k,     n_k: sizes of the rows of A_k

    In weightlessness instead, whether the closed contacts fix the body while no joint moves. Where wrenches were
    logged, whether each of them is inside its cone.
    """
    mass = pin.computeTotalMass(climbed.climber.robot.model)
    if climbed.wrenches is not None:
        _check_logged(climbed, rules, tally, mass * STANDARD)
        return
    gravity = np.asarray(climbed.scene.gravity, dtype=float)
    weightless = not gravity.any() or mass <= 0.0
    rule = "contacts fix the body" if weightless else "contacts bear the robot at rest"
    if weightless:
        tally.declare(rule, FIXES, "singular value", least=True)
    else:
        tally.declare(rule, rules.margin, "of its weight", least=True)
    for k in _instants(climbed, rules.every):
        where = ", ".join(limb.name for limb, row in zip(climbed.climber.limbs, climbed.contacts[k], strict=True)
                          if row != OPEN) or "nothing held"  # fmt: skip
        value = _fixing(climbed, k) if weightless else _margin(climbed, k, mass, gravity)
        tally.add(rule, np.array([value]), climbed.t[k : k + 1], where)


def _instants(climbed: Climbed, every: float) -> list[int]:
    """Ticks at which stances are looked at: both sides of every change, and some between."""
    changes = np.flatnonzero((np.diff(climbed.contacts, axis=0) != 0).any(axis=1))
    regular = np.searchsorted(climbed.t, np.arange(climbed.t[0], climbed.t[-1], every))
    return sorted({*changes.tolist(), *(changes + 1).tolist(), *regular.tolist(), len(climbed.t) - 1})


def cone_at(climbed: Climbed, limb: int, row: int) -> tuple[Array, Array, NDArray[np.bool_]]:
    """A and b of a limb at a foothold, of whose frictions the lower counts, and which rows have a slack to give: a
    component that cannot be borne at all is two rows with b = 0.
    """
    a, b = climbed.climber.limbs[limb].contact.lower(climbed.scene.footholds[row].friction).cone()
    opposed = np.any(np.all(np.abs(a[:, None] + a) < SAME_ROW, axis=2), axis=1)
    return a, b, (b != 0.0) | ~opposed


def _margin(climbed: Climbed, k: int, mass: float, gravity: Array) -> float:
    """The largest slack t; minus infinity where no wrenches hold the robot."""
    model = climbed.climber.robot.model
    center = np.array(pin.centerOfMass(model, model.createData(), climbed.q[k]))
    weight = mass * float(np.linalg.norm(gravity))
    wanted = np.concatenate([-mass * gravity, np.cross(center, -mass * gravity)]) / weight
    places, balance, rows, limits = climbed.tips[0][k], [], [], []
    closed = [(limb, int(row)) for limb, row in enumerate(climbed.contacts[k]) if row != OPEN]
    for at, (limb, row) in enumerate(closed):
        # A limb that fixes its turn may hold at any turn about the normal
        turned = climbed.climber.limbs[limb].contact.fixed == "pose"
        turn = climbed.tips[1][k][limb] if turned else climbed.scene.footholds[row].pose.rotation
        arm = pin.skew(places[limb])
        balance.append(np.block([[turn, np.zeros((3, 3))], [arm @ turn, turn]]))
        a, b, gives = cone_at(climbed, limb, row)
        wide = np.zeros((len(a), 6 * len(closed) + 1))
        wide[:, 6 * at : 6 * at + 6] = a
        wide[:, -1] = gives * np.linalg.norm(a, axis=1)
        rows.append(wide)
        limits.append(b / weight)
    if not closed:
        return -np.inf
    found = least(
        np.append(np.zeros(6 * len(closed)), -1.0), np.vstack(rows), np.concatenate(limits),
        np.hstack([*balance, np.zeros((6, 1))]), wanted, [(None, None)] * (6 * len(closed)) + [(None, ENOUGH)],
    )  # fmt: skip
    return float(found.x[-1]) if found.status == OPTIMAL else -np.inf


def _fixing(climbed: Climbed, k: int) -> float:
    """Least singular value of the rows that closed contacts fix, of a rigid body at their middle."""
    places, turns = climbed.tips[0][k], climbed.tips[1][k]
    closed = np.flatnonzero(climbed.contacts[k] != OPEN).tolist()
    rows = []
    for limb in closed:
        fixed = climbed.climber.limbs[limb].contact.fixed
        rows.append(np.hstack([np.eye(3), -pin.skew(places[limb] - places[closed].mean(axis=0))]))
        if fixed != "position":
            rows.append(np.hstack([np.zeros((3, 3)), turns[limb].T])[: 2 if fixed == "axis" else 3])
    if sum(map(len, rows)) < 6:
        return 0.0
    return float(np.linalg.svd(np.vstack(rows), compute_uv=False)[5])


def _check_logged(climbed: Climbed, rules: CheckRules, tally: RuleTally, weight: float) -> None:
    rule = "contact wrench outside its cone"
    tally.declare(rule, rules.cone, "of its weight")
    assert climbed.wrenches is not None
    for limb, own in enumerate(climbed.climber.limbs):
        for first, last, row in climbed.stretches(limb):
            if row != OPEN:
                a, b, _ = cone_at(climbed, limb, row)
                beyond = (climbed.wrenches[first:last, limb] @ a.T - b).max(axis=1) / weight
                where = f"{own.name} on {climbed.scene.footholds[row].id}"
                tally.add(rule, beyond, climbed.t[first:last], where)
