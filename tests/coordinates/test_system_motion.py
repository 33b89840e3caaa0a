"""The system Jacobian and its pairs, motions carried by lists of pairs, cues for motions with more rows than joints."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pinocchio as pin
import pytest

from tests.coordinates.test_any_arm import jacobian, random_arm
from tests.models import placement
from tests.published.arm_machine import STATE, Machine
from wbc.coordinates import (
    BodyRows,
    CarriedMotion,
    CoordinatePair,
    JointRows,
    Leg,
    PairController,
    SystemMotion,
    carry,
    count_pairs,
    mode_pairs,
    motion_cue,
    parts,
    system_coordinates,
)
from wbc.errors import NotFiniteError, RangeError, ShapeError
from wbc.robot import Robot
from wbc.robots import DHRow, from_dh

SSRMS = parts("ssrms").robot


def test_published_singular_values_and_counts() -> None:
    """Turn and extension: 1.6401219467 and 1; the Space Station arm: 42 coordinates, 252 and 4410 pairs."""
    arm = parts("planar_rp").robot
    points = [BodyRows(f, expressed="world", translation=(0, 1), rotation=()) for f in ("end1", "tip")]
    system = SystemMotion(arm, points)
    for q, wanted in (((0.4, 0.3), 1.6401219467), ((2.0, 0.9), 2.1470910554)):
        sigma = np.linalg.svd(system.jacobian(q), compute_uv=False)
        np.testing.assert_allclose(sigma, (wanted, 1.0), atol=1e-9)
    assert [len(system_coordinates(SSRMS)) * 6, count_pairs(7, 1), count_pairs(7, 2)] == [42, 252, 4410]
    found = SystemMotion(SSRMS).count(STATE)
    assert (found.coordinates, found.pairs) == (42, 252)


def test_regular_pairs_are_those_of_full_rank() -> None:
    """Counted one by one with numpy, rows from Pinocchio; with two joints to spare, too."""
    machine, joints = Machine(SSRMS), range(1, 8)
    J = np.vstack([machine.rows(f"F{k}", STATE) for k in joints])
    J[[r for r in range(42) if r % 6 < 3]] /= SSRMS.characteristic_length
    singles = [(k, r) for k in range(7) for r in range(42) if r // 6 != k]
    good = [np.linalg.svd(np.vstack([J[6 * k : 6 * k + 6], J[r]]), compute_uv=False) for k, r in singles]
    assert SystemMotion(SSRMS).count(STATE).regular == sum(s[-1] > 1e-9 * s[0] for s in good)
    rng = np.random.default_rng(2)
    arm = from_dh([DHRow(a=0.3, d=0.2, alpha=float(x)) for x in rng.uniform(0.5, 1.5, 8)])
    system, q = SystemMotion(arm), rng.uniform(-1.0, 1.0, 8)
    J, count = system.scaled(q), 0
    for k in range(8):
        own, others = J[6 * k : 6 * k + 6], np.delete(J, slice(6 * k, 6 * k + 6), axis=0)
        if np.linalg.svd(own, compute_uv=False)[-1] > 1e-9:
            pairs = np.array([np.vstack([own, others[list(two)]]) for two in combinations(range(42), 2)])
            sigma = np.linalg.svd(pairs, compute_uv=False)
            count += int((sigma[:, -1] > 1e-9 * sigma[:, 0]).sum())
    found = system.count(q)
    assert (found.coordinates, found.pairs, found.regular) == (48, count_pairs(8, 2), count)


@pytest.mark.parametrize("seed", range(4))
def test_the_system_jacobian_never_loses_its_rank(seed: int) -> None:
    """Claim 1 of the generality theorem, at random and at special configurations of random arms."""
    arm = random_arm(seed)
    system, rng = SystemMotion(arm), np.random.default_rng(seed)
    for k in range(20):
        q = rng.uniform(-3.0, 3.0, arm.nv) if k % 2 else rng.integers(-2, 3, arm.nv) * np.pi / 2
        np.testing.assert_allclose(system.jacobian(q), jacobian(arm, system.coordinates, q), atol=1e-12)
        assert system.rank(q) == arm.nv


def carried(robot: Robot, motion: CarriedMotion, count: int = 120) -> np.ndarray:
    """q at the end of a motion that is driven by the rates of its legs alone, by Runge and Kutta's rule."""
    q = motion.q0.copy()
    for leg in motion.legs:
        steps = max(4, int(count * (leg.end - leg.start) / motion.seconds))
        h = (leg.end - leg.start) / steps
        middle = 0.5 * (leg.start + leg.end)
        assert motion.leg(middle) is leg
        for k in range(steps):
            time = leg.start + k * h

            def rate(t: float, x: np.ndarray, leg: Leg = leg) -> np.ndarray:
                at = min(max(t, leg.start + 1e-12), leg.end - 1e-12)
                wanted = np.concatenate(motion.rates(at))
                return np.linalg.lstsq(jacobian(robot, leg.pair.rows, x), wanted, rcond=None)[0]

            a = rate(time, q)
            b = rate(time + h / 2, q + h / 2 * a)
            c = rate(time + h / 2, q + h / 2 * b)
            q = q + h / 6 * (a + 2 * b + 2 * c + rate(time + h, q + h * c))
    return q


@pytest.mark.parametrize(("seed", "given"), [(2, True), (3, False), (4, True), (8, True), (10, False)])
def test_a_list_of_pairs_carries_any_motion(seed: int, given: bool) -> None:
    """Intervals meet, every pair has full rank on its own as Pinocchio says, and the rates lead to q1."""
    arm = random_arm(seed)
    robot, rng = parts(arm).robot, np.random.default_rng(seed)
    pairs = mode_pairs(arm, "M5") if given else ()
    pairs = [*pairs, *(p for p in mode_pairs(arm, "M1") if all(isinstance(o, BodyRows | JointRows) for o in p.rows))]
    q0, q1 = rng.uniform(-1.2, 1.2, (2, robot.nv))
    motion = carry(robot, q0, q1, pairs if given else (), seconds=3.0)
    assert (motion.legs[0].start, motion.legs[-1].end) == (0.0, 3.0)
    assert all(a.end == b.start for a, b in pairwise(motion.legs))
    for leg in motion.legs:
        assert leg.made or given
        for t in np.linspace(leg.start, leg.end, 60):
            sigma = np.linalg.svd(jacobian(robot, leg.pair.rows, motion.at(t)), compute_uv=False)
            assert sigma[-1] > 1e-5 * sigma[0]
    np.testing.assert_allclose(carried(robot, motion), q1, atol=1e-6)


def test_a_pair_is_left_before_its_locus_and_one_is_made_where_all_lose_rank() -> None:
    """Past q2 = 90 degrees alpha gives way to another pair; from the stretched arm, singular for all, one is made."""
    pairs = [pair for pair in mode_pairs("ssrms", "M1") if pair.name in ("xi | alpha", "xi | joint1", "xi | elbow z")]
    q1 = STATE.copy()
    q1[1] = 2.4
    motion = carry(SSRMS, STATE, q1, pairs)
    assert not any(leg.made for leg in motion.legs)
    at = (np.pi / 2 - STATE[1]) / (2.4 - STATE[1])
    assert motion.leg(at).pair.name != "xi | alpha"
    alone = carry(SSRMS, STATE, q1, pairs[:1])
    assert [leg.made for leg in alone.legs] == [False, True, False]
    assert alone.legs[1].start < at < alone.legs[1].end
    start = carry(SSRMS, np.zeros(7), STATE, mode_pairs("ssrms", "M1"))
    assert start.legs[0].made
    assert not start.legs[-1].made
    still = carry(SSRMS, STATE, STATE, pairs)
    assert len(still.legs) == 1
    assert not still.velocity.any()


def test_pairs_are_made_only_where_no_given_one_serves() -> None:
    """On random motions of the Space Station arm: 15 % of the paths before samples were set closer for given pairs."""
    rng, part = np.random.default_rng(0), 0.0
    for _ in range(12):
        pairs = mode_pairs("ssrms", "M1")[: int(rng.integers(2, 9))]
        motion = carry(SSRMS, rng.uniform(-2.0, 2.0, 7), rng.uniform(-2.0, 2.0, 7), pairs)
        part += sum(leg.end - leg.start for leg in motion.legs if leg.made) / 12
    assert part < 0.04


def test_bad_motions_and_counts() -> None:
    with pytest.raises(ShapeError):
        carry(SSRMS, STATE[:3], STATE)
    with pytest.raises(NotFiniteError):
        carry(SSRMS, STATE, STATE * np.nan)
    with pytest.raises(ShapeError, match="CoordinatePairs"):
        carry(SSRMS, STATE, STATE, ["xi | alpha"])  # type: ignore[list-item]
    for bad in ({"seconds": 0.0}, {"share": 2.0}):
        with pytest.raises(RangeError):
            carry(SSRMS, STATE, STATE, **bad)  # type: ignore[arg-type]
    motion = carry(SSRMS, STATE, STATE + 0.1)
    with pytest.raises(RangeError):
        motion.rates(1.5)
    for bodies, constraints in ((0, 1), (7, -1), (True, 1), (7, 1.5)):
        with pytest.raises(RangeError):
            count_pairs(bodies, constraints)  # type: ignore[arg-type]
    with pytest.raises(RangeError, match="six joints"):
        SystemMotion(parts("spherical_4r").robot).count(np.zeros(4))
    with pytest.raises(RangeError, match="too many"):
        SystemMotion(parts("spdm").robot).count(np.zeros(15))


ELBOW = mode_pairs("ssrms", "M8")[0]


def test_a_cue_has_the_published_motion() -> None:
    """Tip held, elbow (0, 0, 0.05) asked: (0.005965691, 0.011088626, 0.003402479) along the one direction there is."""
    cue = motion_cue(SSRMS, ELBOW, STATE, (0.0, 0.0, 0.05))
    np.testing.assert_allclose(cue.met, (0.005965691, 0.011088626, 0.003402479), atol=1e-7)
    assert (cue.directions.shape, cue.blocked.shape) == ((1, 3), (2, 3))
    np.testing.assert_allclose(np.abs(cue.directions[0] @ cue.met), np.linalg.norm(cue.met), atol=1e-12)
    np.testing.assert_allclose(cue.blocked @ cue.met, 0.0, atol=1e-12)
    along = "(+0.46 elbow x, +0.85 elbow y, +0.26 elbow z)"
    assert str(cue) == f"1 of 3 directions can be had along {along}; 26 % of the command is met"
    planar = parts("planar_3r")
    (pair,) = mode_pairs("planar_3r", "M8")
    found = motion_cue(planar.robot, pair, (0.3, 0.7, -0.4), (0.0, 0.1))
    np.testing.assert_allclose(found.met, (-0.0413704303, 0.0780800195), atol=1e-9)
    assert np.linalg.norm(found.missing) == pytest.approx(0.0468187789, abs=1e-9)


@pytest.mark.parametrize("metric", [None, 0.7])
def test_a_cue_is_what_is_driven_and_no_motion_is_nearer(metric: float | None) -> None:
    """More rows than joints, mixed units: the controller's rates, and least squares over the null space."""
    robot, (tip, middle) = SSRMS, (parts("ssrms").arms[0].tip, parts("ssrms").arms[0].middle)
    pair = CoordinatePair(tip, (middle, JointRows("joint7")), metric=metric)
    rates = np.array([0.01, -0.02, 0.005, 0.001, 0.002, -0.001])
    cue = motion_cue(robot, pair, STATE, rates)
    control = PairController(robot, pair, limits=False, backend="vm")
    control.reset(STATE)
    control.command(rates)
    np.testing.assert_allclose(control.met(control.step(STATE).v), cue.met, atol=1e-7)
    held = jacobian(robot, pair.constraint, STATE)
    free = np.linalg.svd(held)[2][4:].T
    task = jacobian(robot, (tip,), STATE)
    turn = placement(robot, "tip", STATE).rotation
    if metric is None:
        weigh = np.diag([1.0 / robot.characteristic_length] * 3 + [1.0] * 3)
    else:
        weigh = np.vstack([np.hstack([np.eye(3), -pin.skew(metric * turn[:, k])]) for k in range(3)])
    v = np.linalg.lstsq(weigh @ task @ free, weigh @ rates, rcond=None)[0]
    np.testing.assert_allclose(cue.met, task @ free @ v, atol=1e-10)
    assert cue.lost**2 + cue.share**2 == pytest.approx(1.0)


def test_cues_where_all_or_nothing_can_be_had() -> None:
    square = mode_pairs("ssrms", "M1")[0]
    assert str(motion_cue(SSRMS, square, STATE, np.ones(6))) == "all 6 directions can be had"
    everything = CoordinatePair(ELBOW.task, [parts("ssrms").arms[0].tip])
    stuck = STATE.copy()
    stuck[[1, 2]] = np.pi / 2, np.pi / 2
    cue = motion_cue(SSRMS, everything, stuck, (0.1, 0.0, 0.0))
    np.testing.assert_allclose(cue.met, 0.0, atol=1e-9)
    assert "none of 3 directions" in str(cue)
    assert (cue.lost, motion_cue(SSRMS, ELBOW, STATE, np.zeros(3)).lost) == (pytest.approx(1.0), 0.0)
    with pytest.raises(ShapeError):
        motion_cue(SSRMS, ELBOW, STATE, (1.0, 2.0))
    with pytest.raises(ShapeError, match="expected a CoordinatePair"):
        motion_cue(SSRMS, "elbow | xi", STATE, (1.0, 2.0))  # type: ignore[arg-type]
