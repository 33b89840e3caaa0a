"""Every mode of manual control drives every arm that has its rows: what is commanded moves, what is held is still."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from wbc.coordinates import (
    Coordinate,
    CoordinatePair,
    MissingPartError,
    Mode,
    PairController,
    mode_pairs,
    mode_table,
    parts,
)
from wbc.robots.operator_arms import OPERATOR_ARMS

#: Configurations that each pair has the best conditioned of, ticks of a pair, fastest joint [rad/s, m/s]
STATES, TICKS, SPEED = 30, 3, 0.01
TABLE = mode_table()


@dataclass(frozen=True)
class Driven:
    """One arm with all pairs of all its modes in one stack."""

    control: PairController
    names: dict[CoordinatePair, str]
    states: np.ndarray


@cache
def driven(name: str) -> Driven:
    robot = parts(name).robot
    found = [pair for row in TABLE[name].values() if not isinstance(row, str) for pair in row]
    # Two modes may share a pair, or a name for different ones
    named = {(pair.task, pair.constraint): CoordinatePair(pair.task, pair.constraint, str(pair)) for pair in found}
    pairs = [CoordinatePair(*rows, f"{k} {one.name}") for k, (rows, one) in enumerate(named.items())]
    control = PairController(robot, pairs, limits=False, backend="vm")
    by_rows = {(pair.task, pair.constraint): pair.name for pair in pairs}
    names = {pair: by_rows[pair.task, pair.constraint] for pair in found}
    return Driven(control, names, np.random.default_rng(1).uniform(-1.5, 1.5, (STATES, robot.nq)))


@cache
def matrices(name: str) -> dict[Coordinate, np.ndarray]:
    """Of every coordinate at every state [states, rows, nv]."""
    arm = driven(name)
    found = [arm.control.rates(q) for q in arm.states]
    return {one: np.array([rates[one] for rates in found]) for one in found[0]}


def best(name: str, pair: CoordinatePair) -> int:
    """The state where the pair's least singular value, metres over the arm's length, is largest."""
    length = parts(name).robot.characteristic_length
    units = driven(name).control.units(pair.rows)
    scale = np.array([1.0 / length if unit == "m" else 1.0 for unit in units])
    J = np.concatenate([matrices(name)[one] for one in pair.rows], axis=1)
    return int(np.argmax(np.linalg.svd(scale[:, None] * J, compute_uv=False)[:, -1]))


@pytest.mark.parametrize("mode", list(Mode), ids=lambda mode: mode.name)
@pytest.mark.parametrize("name", OPERATOR_ARMS)
def test_a_mode_drives_an_arm_or_says_what_is_missing(name: str, mode: Mode) -> None:
    """Rates that the held rows allow are commanded: they are met, and the sum of what is held stays zero."""
    found = TABLE[name][mode]
    if isinstance(found, str):
        with pytest.raises(MissingPartError, match=f"{mode.name} on {name}") as caught:
            mode_pairs(name, mode)
        assert caught.value.part == found
        return
    control = driven(name).control
    for pair in found:
        state = best(name, pair)
        q, there = driven(name).states[state].copy(), matrices(name)
        nothing = np.zeros((0, len(q)))
        held, led = (np.vstack([nothing, *(there[o][state] for o in rows)]) for rows in (pair.constraint, pair.task))
        free = np.eye(held.shape[1]) - np.linalg.pinv(held, rcond=1e-6) @ held
        rates = free @ np.linspace(1.0, 0.6, len(free))
        command = led @ (SPEED * rates / np.abs(rates).max())
        assert np.abs(command).max() > 1e-4, pair.name
        control.switch(driven(name).names[pair], 0.0)
        control.reset(q)
        control.command(command)
        gone = np.zeros(len(held))
        for _ in range(TICKS):
            step = control.step(q)
            assert step.ended == "solved", pair.name
            A = control.rates(q)
            met = np.concatenate([A[one] @ step.v for one in pair.task])
            assert np.abs(met - command).max() < 1e-3 * np.abs(command).max(), pair.name
            still = np.concatenate([np.zeros(0), *(A[one] @ step.v for one in pair.constraint)])
            assert np.abs(still).max(initial=0.0) < 1e-3 * np.abs(command).max(), pair.name
            gone = gone + control.dt * still
            q = q + control.dt * step.v
        assert np.abs(gone).max(initial=0.0) < 1e-6, pair.name
        assert np.abs(q - driven(name).states[state]).max() > 0.5 * SPEED * TICKS * control.dt, pair.name
