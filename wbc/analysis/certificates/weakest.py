"""Where a set of coordinates is weakest: a numeric search for the least singular values, and witnesses from it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.trig_form import TrigForm
from wbc.analysis.jacobians.model import ExactModel
from wbc.analysis.jacobians.numeric import NumericRows, rank, singular_values
from wbc.analysis.rows import Rows
from wbc.validation import Array

#: Random configurations
STARTS = 4000
#: The weakest of them, from which a minimum is followed
FOLLOWED = 48
#: Steps towards a minimum
STEPS = 80
#: Steps towards a null vector
NEWTON = 40
#: Configurations that are looked at before the clock is
CHUNK = 500


@dataclass(frozen=True, eq=False)
class RankWitness:
    """A configuration where the task keeps away from a loss of rank and task and constraints together have one.

    Attributes:
        q: configuration of the robot [nq]. task, augmented: singular values of the Jacobians of the task, and of task
            and constraints, there, by Pinocchio. branch: of the locus, on which it lies; None: it was found by numbers.
    """

    q: Array
    task: Array
    augmented: Array
    branch: LocusBranch | None = None


def least(matrices: Array) -> Array:
    """The smallest singular value of each of many matrices."""
    return np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, -1])


def joint_values(model: ExactModel, q: Array) -> Array:
    """One number a joint, as the forms take them, of a configuration of the robot [nq]."""
    out = np.empty(model.robot.nv)
    for k, joint in enumerate(model.ring.coordinates):
        two = int(model.robot.model.nqs[joint.dof + 1]) == 2
        out[k] = np.arctan2(q[joint.index + 1], q[joint.index]) if two else q[joint.index]
    return out


def descended(
    cost: Callable[[Array], Array],
    joints: int,
    rng: np.random.Generator,
    starts: int = STARTS,
    steps: int = STEPS,
    until: float = inf,
) -> tuple[Array, Array]:
    """(configurations, costs) after random starts and random steps that shrink where they fail; least cost first.

    Args:
        until: a time of the monotonic clock, at which the steps end.
    """
    q = rng.uniform(-np.pi, np.pi, (starts, joints))
    value = np.full(starts, np.inf)
    for part in np.array_split(np.arange(starts), max(1, starts // CHUNK)):
        value[part] = cost(q[part])
        if time.monotonic() > until:
            break
    best = np.argsort(value)[:FOLLOWED]
    q, value, step = q[best], value[best], np.full(FOLLOWED, 0.3)
    for _ in range(steps):
        if time.monotonic() > until:
            break
        tried = q + rng.normal(size=q.shape) * step[:, None]
        there = cost(tried)
        better = there < value
        q, value = np.where(better[:, None], tried, q), np.where(better, there, value)
        step = np.where(better, 1.3 * step, 0.85 * step)
    order = np.argsort(value)
    return q[order], value[order]


def peak(task: TrigForm, rng: np.random.Generator, until: float = inf) -> float:
    """The largest sigma_min(J_T) that the search finds."""
    _, value = descended(lambda q: -least(task.value(q)), task.waves.shape[1], rng, until=until)
    return float(-value[0])


def weakest(
    task: TrigForm | None,
    constraints: Sequence[TrigForm],
    eps: float,
    rng: np.random.Generator,
    until: float = inf,
) -> tuple[Array, Array]:
    """(configurations, sigma_min(J_R) / sigma_min(J_T)) where the ratio is least, sigma_min(J_T) >= eps.

    Without a task sigma_min(J_R) alone.
    """

    def cost(q: Array) -> Array:
        if task is None:
            return least(np.concatenate([form.value(q) for form in constraints], axis=1))
        rows = task.value(q)
        own = least(rows)
        together = np.concatenate([rows, *(form.value(q) for form in constraints)], axis=1)
        if together.shape[1] < together.shape[2]:
            return np.where(own < eps, np.inf, 0.0)
        return np.where(own < eps, np.inf, least(together) / np.maximum(own, 1e-300))

    return descended(cost, constraints[0].waves.shape[1], rng, until=until)


def numeric_witness(
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    augmented: TrigForm,
    starts: Array,
    eps: float,
    *,
    until: float = inf,
) -> RankWitness | None:
    """The first configuration, found from starts, where J_R v = 0 for some |v| = 1 and sigma_min(J_T) >= eps.

    Without a task the second does not count. Both are checked by Pinocchio's Jacobians.
    """
    numeric = NumericRows(model.robot)
    for point in _null_points(augmented, starts, until):
        q = model.configuration(np.remainder(point + np.pi, 2 * np.pi) - np.pi)
        J_R = numeric.value((*task, *constraints), q)
        sigma = singular_values(numeric.value(task, q)) if task else np.empty(0)
        if rank(J_R) < model.robot.nv and (not task or sigma[-1] >= eps):
            return RankWitness(q, sigma, singular_values(J_R))
    return None


def _null_points(form: TrigForm, starts: Array, until: float) -> Array:
    """Where M(q) v = 0, |v| = 1 was solved from starts: damped Gauss and Newton steps in (q, v), all starts at once."""
    q = starts.copy()
    v = np.linalg.svd(form.value(q))[2][:, -1]
    joints = q.shape[1]
    for _ in range(NEWTON):
        if time.monotonic() > until:
            break
        matrix = form.value(q)
        residual = np.concatenate((np.einsum("sij,sj->si", matrix, v), (v * v).sum(1, keepdims=True) - 1.0), axis=1)
        by_q = np.einsum("skij,sj->sik", form.slopes(q), v)
        top = np.concatenate((by_q, matrix), axis=2)
        below = np.concatenate((np.zeros_like(q), 2.0 * v), axis=1)[:, None]
        J = np.concatenate((top, below), axis=1)
        damping = (1e-14 + (residual * residual).sum(1))[:, None, None] * np.eye(2 * joints)
        gradient = np.einsum("sji,sj->si", J, residual)
        step = np.linalg.solve(np.einsum("sji,sjk->sik", J, J) + damping, gradient[:, :, None])[:, :, 0]
        q, v = q - step[:, :joints], v - step[:, joints:]
    solved = np.abs(np.einsum("sij,sj->si", form.value(q), v)).max(1) < 1e-8
    return np.asarray(q[solved])
