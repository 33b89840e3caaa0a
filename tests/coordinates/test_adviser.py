"""Conditioning against numpy, advice against known loci, changes by themselves, the smallest complete sets."""

from __future__ import annotations

from math import pi

import numpy as np
import pinocchio as pin
import pytest

from tests.published.arm_machine import Machine, rank
from wbc.coordinates import (
    Adviser,
    AutomaticPairs,
    Basis,
    BodyRows,
    Condition,
    Conditioning,
    Coordinate,
    CoordinatePair,
    JointRows,
    PairController,
    closed_form,
    expressions,
    mode_pairs,
    parts,
    smallest_complete_sets,
    survey_pairs,
)
from wbc.coordinates.control.singular import LeastSingular
from wbc.errors import DuplicateNameError, RangeError, ShapeError, UnknownNameError
from wbc.robots import DHRow, from_dh

STATES = np.random.default_rng(0).uniform(-pi, pi, (30, 7))
STATE = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
FOUR = parts("spherical_4r")
TIP, ALPHA, (BETA,) = FOUR.arms[0].tip, FOUR.arms[0].alpha, FOUR.arms[0].in_plane
assert ALPHA is not None
PAIRS = (CoordinatePair(TIP, ALPHA, "alpha"), CoordinatePair(TIP, BETA, "beta"))


@pytest.fixture(scope="module")
def adviser() -> Adviser:
    return Adviser(FOUR.robot, PAIRS, length=1.0)


@pytest.mark.parametrize("backend", ["native", "vm"])
def test_singular_values_are_numpys_and_slopes_are_their_derivatives(backend: str) -> None:
    """Wide, square and tall groups of the Space Station arm, to 1e-12, degenerate places included."""
    arm, robot = parts("ssrms").arms[0], parts("ssrms").robot
    assert arm.alpha is not None
    assert arm.middle is not None
    groups = [(arm.tip,), (arm.tip, arm.alpha), (arm.tip, arm.middle, *arm.in_plane), (arm.alpha,)]
    made, h = Conditioning(robot, groups, backend=backend), 1e-6
    assert made.compiled == (backend == "native")
    flat = STATES[:5].copy()
    flat[:, 3] = 0.0
    for q in (*STATES, *flat):
        wanted = [np.linalg.svd(J, compute_uv=False)[-1] for J in made.matrices(q)]
        np.testing.assert_allclose(made.sigmas(q), wanted, atol=1e-12)
    for many, one in zip(made.many(STATES[:3]), made.matrices(STATES[2]), strict=True):
        np.testing.assert_allclose(many[2], one, atol=1e-14)
    for q in STATES[:4]:
        sigma, slopes, right = made.slopes(q)
        np.testing.assert_allclose(sigma, made.sigmas(q), atol=1e-14)
        steps = [(made.sigmas(q + h * e) - made.sigmas(q - h * e)) / (2 * h) for e in np.eye(7)]
        np.testing.assert_allclose(slopes, np.transpose(steps), atol=1e-6)
        for J, s, v in zip(made.matrices(q), sigma, right, strict=True):
            assert np.linalg.norm(J @ v) == pytest.approx(s, abs=1e-12)


@pytest.mark.parametrize("backend", ["native", "vm"])
def test_braked_joints_are_left_out_and_metres_count_by_the_arm(backend: str) -> None:
    """15 and 22 joints: numpy's singular values of the rows and columns that brakes leave, slopes by differences."""
    for name in ("spdm", "spdm_on_ssrms")[: 1 if backend == "native" else 2]:
        arm, robot = parts(name).arms[1], parts(name).robot
        assert arm.middle is not None
        assert arm.alpha is not None
        moving = [k for k, n in enumerate(robot.dof_names) if n.startswith("arm2_")]
        brakes = [n for n in robot.dof_names if not n.startswith("arm2_")]
        groups: list[tuple[Coordinate, ...]] = [(arm.tip, arm.alpha), (arm.tip, arm.middle), (arm.tip,)]
        made = Conditioning(robot, groups, brakes=[brakes, brakes, ()], backend=backend)
        length = parts("spdm_arm").robot.characteristic_length
        q = np.random.default_rng(5).uniform(-1.5, 1.5, robot.nq)
        sigmas = made.sigmas(q)
        for group, sigma, columns in zip(groups, sigmas, (moving, moving, slice(None)), strict=True):
            J = np.asarray(expressions.rate_function(robot, group)(q).full())[:, columns]
            units = [row.unit for one in group for row in expressions.labels(robot, one)]
            J = J * [[1.0 / length if unit == "m" else 1.0] for unit in units]
            assert sigma == pytest.approx(np.linalg.svd(J, compute_uv=False)[-1], rel=1e-9)
        assert made.chosen([2, 0])(q).tolist() == [sigmas[2], sigmas[0]]
        _, slopes, right = made.slopes(q)
        assert np.abs(np.delete(right[0], moving)).max() == 0.0
        h = 1e-6 * np.eye(robot.nv)[[moving[1], moving[3]]]
        found = [(made.sigmas(q + d) - made.sigmas(q - d))[:2] / 2e-6 for d in h]
        np.testing.assert_allclose(slopes[:2, [moving[1], moving[3]]], np.transpose(found), atol=1e-6)


def test_singular_values_of_matrices_that_fall_apart() -> None:
    """Entries alone in their row and column, empty rows and columns, wide and tall: numpy's least singular value."""
    least, rng = LeastSingular(), np.random.default_rng(2)
    assert least.compiled
    for rows, columns in ((3, 3), (3, 8), (8, 3), (6, 7), (1, 5), (5, 1), (26, 22), (15, 15)):
        M = rng.normal(size=(rows, columns))
        for change in range(5):
            if change == 1:
                M[0], M[:, 0] = 0.0, 0.0
                M[0, 0] = -0.3
            elif change == 2:
                M[-1, :-1] = 0.0
            elif change == 3:
                M[:, -1] = 0.0
            elif change == 4:
                M[-1] = 0.0
            wanted = np.linalg.svd(M, compute_uv=False)[-1]
            assert least(M) == pytest.approx(wanted, rel=1e-12, abs=1e-14)
            assert LeastSingular(native=False)(M) == pytest.approx(wanted, abs=1e-14)


def test_a_free_body_joint_helps_where_the_arm_by_itself_is_singular() -> None:
    """15 joints: the best of M1 keeps 0.3 of what the task has; the pairs that lock the body joint do not."""
    robot, pairs = parts("spdm").robot, mode_pairs("spdm", "M1")
    found = survey_pairs(robot, pairs, 1500)
    assert found.quantile(0.0) > 0.45
    fixed = [k for k, pair in enumerate(pairs) if JointRows("body_joint") in pair.constraint]
    assert (len(pairs), len(fixed)) == (14, 9)
    # Stretched, with the yaw joint at 90 degrees: near a singularity of the arm by itself
    stretched = np.array([0.2, 0.3, pi / 2, -0.5, 0.0, 0.7, -0.6, 0.9, *STATE])
    sigmas, task = Adviser(robot, pairs, backend="vm").singular_values(stretched)
    assert sigmas[fixed].max() < 0.1 * task[0]
    assert sigmas.max() > 0.8 * task[0] > 0.1


def test_advice_near_and_on_loci(adviser: Adviser) -> None:
    near, far = adviser.advise((0.3, 1.5, -0.7, 1.1))
    assert (near.pair, near.basis, near.locus) == ("alpha", Basis.EXACT, "joint2 = 1.571")
    assert near.distance == pytest.approx(pi / 2 - 1.5)
    np.testing.assert_array_equal(near.direction, (0.0, 1.0, 0.0, 0.0))
    assert far.ratio > 0.9
    on, _ = adviser.advise((0.3, pi / 2, -0.7, 1.1))
    assert on.condition is Condition.ALGORITHMIC
    assert on.distance < 1e-9
    stretched = adviser.advise((0.3, 0.5, -0.7, 0.0))
    assert {a.condition for a in stretched} == {Condition.TASK}


def test_estimates_say_so_and_are_right_to_first_order() -> None:
    """Near a relation of three joints, which no single angle shows, the estimate is the distance to it."""
    robot, (pair,) = parts("ssrms").robot, [p for p in mode_pairs("ssrms", "M1") if p.name == "xi | joint1"]
    root = STATE.copy()
    root[2] = -2.187788992  # (4.30) with q4 = 1.2, q5 = 0.7
    adviser = Adviser(robot, [pair])
    (on,) = adviser.advise(root)
    assert on.distance < 1e-7
    # Across the locus the way back is the whole way
    (aside,) = adviser.advise(root - 0.02 * on.direction)
    assert aside.basis is Basis.FIRST_ORDER
    assert aside.distance == pytest.approx(0.02, rel=0.05)
    assert aside.locus == ""


def test_closed_forms() -> None:
    robot = parts("ssrms").robot
    pairs = {p.name: p for p in mode_pairs("ssrms", "M1")}
    found = closed_form(robot, pairs["xi | joint2"])
    assert found is not None
    assert found.lines[:3] == ("q2 = +-pi/2", "q4 in {0, pi}", "q6 = +-pi/2")
    assert sorted({p.joint for p in found.places}) == ["joint2", "joint4", "joint6"]
    assert closed_form(robot, pairs["xi | elbow x"]) is None
    first = closed_form(FOUR.robot, PAIRS[0])
    assert first is not None
    assert first.lines == ("q2 = +-pi/2", "q4 in {0, pi}")


def test_recommendation_has_hysteresis(adviser: Adviser) -> None:
    def at(q2: float) -> tuple[float, float, float, float]:
        return (0.3, q2, -0.7, 1.1)

    assert adviser.recommend(at(0.5)) == "alpha"
    assert adviser.recommend(at(0.9)) == "beta"
    assert adviser.recommend(at(0.9), "alpha") == "alpha"
    assert adviser.recommend(at(1.2), "alpha") == "beta"
    assert adviser.recommend(at(0.5), "beta") == "beta"
    assert adviser.recommend(at(0.1), "beta") == "alpha"


def test_pairs_change_by_themselves_through_a_locus(adviser: Adviser) -> None:
    """The tip is driven so that joint 2 passes 90 degrees, where the pitch plane cannot be held."""
    robot = FOUR.robot.with_limits(acceleration=0.6, position_lower=-3.0, position_upper=3.0)
    control = PairController(robot, PAIRS, limits=True, length=1.0)
    auto, q = AutomaticPairs(control, adviser, seconds=0.4), np.array((0.3, 0.9, -0.7, 1.1))
    control.reset(q)
    wanted = np.array((0.0, 0.3, 0.0, 0.02))
    last, worst, off, passed = np.zeros(4), 0.0, 0.0, 0.0
    for tick in range(160):
        command = min(1.0, tick / 40) * control.rates(q)[TIP] @ wanted
        auto.command(command)
        v = auto.step(q).v
        worst, last = max(worst, float(np.abs(v - last).max() / control.dt)), v
        off = max(off, float(np.linalg.norm(control.rates(q)[TIP] @ v - command)))
        q = pin.integrate(robot.model, q, control.dt * v)
        passed = max(passed, q[1])
    assert [name for _, name in auto.changes] == ["beta"]
    assert passed > pi / 2
    assert worst < 0.6 + 1e-6
    # What the acceleration limit takes from a command of 0.4 m/s
    assert off < 5e-3


def test_smallest_complete_sets_are_the_published_ones() -> None:
    arm = FOUR.arms[0]
    assert arm.middle is not None
    found = smallest_complete_sets(FOUR.robot, arm.tip, [ALPHA, BETA, arm.middle])
    assert [[str(one) for one in s.constraint] for s in found] == [["alpha", "beta"], ["beta", "elbow"]]
    assert {s.verdict for s in found} == {"loose"}
    assert min(s.least for s in found) > 0.1
    assert smallest_complete_sets(FOUR.robot, arm.tip, [ALPHA]) == ()


def test_bad_input(adviser: Adviser) -> None:
    with pytest.raises(ShapeError):
        Adviser(FOUR.robot, [])
    with pytest.raises(DuplicateNameError):
        Adviser(FOUR.robot, [PAIRS[0], CoordinatePair(TIP, BETA, "alpha")])
    with pytest.raises(RangeError):
        Adviser(FOUR.robot, PAIRS, factor=0.5)
    with pytest.raises(ShapeError):
        adviser.advise((0.0, 1.0))
    with pytest.raises(UnknownNameError, match="did you mean 'beta'"):
        adviser.recommend((0.3, 0.5, -0.7, 1.1), "bta")
    with pytest.raises(ShapeError):
        Conditioning(FOUR.robot, [])
    for brakes in ([], [FOUR.arms[0].joints]):
        with pytest.raises(ShapeError, match="brakes"):
            Conditioning(FOUR.robot, [(TIP,)], brakes=brakes)
    with pytest.raises(UnknownNameError, match="joint1"):
        Conditioning(FOUR.robot, [(TIP,)], brakes=[["joint"]])
    control = PairController(FOUR.robot, PAIRS[0], backend="vm")
    with pytest.raises(RangeError, match="no such pair"):
        AutomaticPairs(control, adviser)
    with pytest.raises(RangeError, match="up to 7 joints"):
        smallest_complete_sets(parts("spdm").robot, BodyRows("arm1_tip"), [JointRows("body_joint")])


def test_a_survey_is_of_singular_values_at_configurations_within_limits() -> None:
    robot = FOUR.robot.with_limits(position_lower=-1.0, position_upper=2.0)
    found = survey_pairs(robot, PAIRS, 50, seed=3)
    assert found.states.shape == (50, 4)
    assert found.states.min() < -0.9
    assert found.states.max() > 1.9
    assert np.abs(found.states - 0.5).max() <= 1.5
    exact = Conditioning(robot, [(TIP,), *(pair.rows for pair in PAIRS)], backend="vm")
    for q, ratio, task, name in zip(found.states, found.ratios, found.tasks, found.best, strict=True):
        alone, *both = exact.sigmas(q)
        assert task == pytest.approx(alone, rel=1e-9)
        assert ratio == pytest.approx(max(both) / alone, rel=1e-9)
        assert name == ("alpha", "beta")[int(np.argmax(both))]
    assert found.ratios[found.worst] == found.quantile(0.0)
    for bad in (0, -1, True, 1.5):
        with pytest.raises(RangeError, match="count"):
            survey_pairs(robot, PAIRS, bad)  # type: ignore[arg-type]


def test_a_straight_elbow_takes_the_rank_of_some_pairs_and_not_of_the_task() -> None:
    """Joint 4 at 0: the task has rank 6 and the elbow point keeps the seventh; alpha, beta, gamma and locks lose it."""
    robot, pairs = parts("ssrms").robot, mode_pairs("ssrms", "M1")
    adviser, machine = Adviser(robot, pairs, backend="vm"), Machine(robot)
    for q in (STATE.copy(), *np.random.default_rng(0).uniform(-2.0, 2.0, (6, 7))):
        q[3] = 0.0
        assert rank(machine.rows("tip", q)) == 6
        found = {one.pair.removeprefix("xi | "): one for one in adviser.advise(q)}
        for name, one in found.items():
            if not name.startswith("elbow"):
                assert (one.condition, one.distance) == (Condition.ALGORITHMIC, pytest.approx(0.0, abs=1e-9)), name
        best = max((one for name, one in found.items() if name.startswith("elbow")), key=lambda one: one.sigma)
        # Though its least singular value is about 0.01, which a fixed threshold took for a lost rank
        assert best.condition is Condition.REGULAR
        assert best.ratio > 0.9
        assert best.sigma < 0.02
        assert adviser.recommend(q, "xi | alpha") in {one.pair for one in found.values() if one.ratio > 0.6}


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_lost_ranks_do_not_depend_on_the_size_of_an_arm(scale: float) -> None:
    """A UR5 and its copies in other units: ranks are lost where wrist 2 or the elbow is straight, and only there."""
    rows = ((0.089, 0.0, np.pi / 2), (0.0, -0.425, 0.0), (0.0, -0.392, 0.0))
    rows = (*rows, (0.109, 0.0, np.pi / 2), (0.095, 0.0, -np.pi / 2), (0.082, 0.0, 0.0))
    arm = from_dh([DHRow(d=scale * d, a=scale * a, alpha=turn) for d, a, turn in rows])
    adviser = Adviser(parts(arm).robot, mode_pairs(arm, "M1"), backend="vm")
    for joint in (2, 4):
        for off, lost in ((0.0, True), (0.015, True), (0.03, False)):
            q = np.array([0.3, -1.0, 0.9, -0.8, 1.0, 0.2])
            q[joint] = off
            (found,) = adviser.advise(q)
            assert (found.condition is Condition.TASK) == lost, (joint, off)
            assert found.distance == pytest.approx(off, abs=1e-9)


def test_the_default_adviser_takes_arms_that_exact_analysis_refuses() -> None:
    """The Panda's hand is turned by 45 degrees: no determinant is factored, and distances are estimates."""
    robot, pairs = parts("panda").robot, mode_pairs("panda", "M1")
    q = robot.neutral
    found = Adviser(robot, pairs).advise(q)
    assert len(found) == len(pairs)
    assert {one.basis for one in found} == {Basis.FIRST_ORDER}
    assert closed_form(robot, pairs[1]) is None
    # The lock of joint 2 loses its rank here, as the numbers say
    J = np.vstack([Machine(robot).rows("panda_hand_tcp", q), np.eye(7)[1]])
    assert rank(J) == 6
    assert {one.pair: one.condition for one in found}["pose | panda_joint2"] is Condition.ALGORITHMIC


def test_pairs_with_other_tasks_are_not_compared() -> None:
    """Of pairs that command other coordinates none is recommended in place of the current one."""
    every = [*PAIRS, *(CoordinatePair(one, TIP, f"{one} back") for one in (ALPHA, BETA))]
    adviser = Adviser(FOUR.robot, every, exact=False, backend="vm")
    at = (0.3, pi / 2, -0.7, 1.1)
    assert adviser.recommend(at, "alpha") == "beta"
    assert adviser.recommend(at, "alpha back") == "alpha back"
    sigma, task, name = adviser.look(at, "alpha")
    assert (sigma, name) == (pytest.approx(0.0, abs=1e-12), "beta")
    assert task == pytest.approx(adviser.singular_values(at)[1][0])
