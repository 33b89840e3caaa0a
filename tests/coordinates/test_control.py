"""Pairs at run time: exact rows, switches without a jump, places that are held."""

from __future__ import annotations

import pickle

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.models import placement
from tests.random_robots import Drawn, random_model
from tests.repeats import repeats
from wbc.coordinates import (
    Adviser,
    AxisRows,
    BodyRows,
    CoordinatePair,
    JointRows,
    PairController,
    PitchPlaneRows,
    mode_pairs,
    motion_cue,
    parts,
)
from wbc.coordinates.control.pair_stack import row_count
from wbc.coordinates.control.rank_loss import Condition
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robot import Robot
from wbc.robots import load, operator_arm

STATE = np.array([0.3, 0.5, -0.7, 1.1])
#: Of four joints; what arms of seven hold besides is in test_second_arm.py
ARM = parts("spherical_4r").robot.with_limits(acceleration=0.4, position_lower=-2.0, position_upper=2.0)
TIP, ALPHA = BodyRows("tip", rotation=(), name="tip"), PitchPlaneRows("F3", "tip")
BETA = parts("spherical_4r").arms[0].in_plane[0]
PAIRS = (
    CoordinatePair(TIP, ALPHA, "plane"),
    CoordinatePair(TIP, BETA, "shoulder"),
    CoordinatePair(ALPHA, TIP, "self"),
)


@pytest.fixture(scope="module")
def compiled() -> PairController:
    return PairController(ARM, PAIRS)


@pytest.fixture
def control(compiled: PairController) -> PairController:
    compiled.switch("plane", 0.0)
    compiled.reset(STATE)
    return compiled


def place(q: np.ndarray, frame: str = "tip") -> np.ndarray:
    return np.array(placement(ARM, frame, q).translation)


def run(control: PairController, q: np.ndarray, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """(configuration after the ticks, all rates)."""
    rates = []
    for _ in range(ticks):
        step = control.step(q)
        rates.append(step.v)
        q = pin.integrate(ARM.model, q, step.v * control.dt)
    return q, np.array(rates)


def test_a_switch_keeps_rates_continuous_and_what_both_pairs_hold(control: PairController) -> None:
    """From task and pitch plane to task and beta while the tip moves: no joint changes faster than its limit."""
    control.command((0.1, 0.05, -0.04))
    q, before = run(control, STATE, 60)
    seconds = control.switch("shoulder", 0.4)
    assert seconds >= 0.4
    assert control.blending
    where = place(q)
    q, after = run(control, q, round(seconds / control.dt) + 20)
    assert not control.blending
    change = np.abs(np.diff(np.vstack((before[-1:], after)), axis=0)).max() / control.dt
    assert change < 0.4
    # The tip went on at the commanded rate all the time; the new constraint is exact in the end
    moved = place(q) - where
    np.testing.assert_allclose(moved, len(after) * control.dt * np.array((0.1, 0.05, -0.04)), atol=2e-3)
    assert abs(control.rates(q)[BETA] @ control.controller.last_command) < 1e-4
    # The same switch without a blend asks for more
    J = np.vstack((control.rates(q)[TIP], control.rates(q)[ALPHA]))
    assert np.abs(np.linalg.solve(J, (0.1, 0.05, -0.04, 0.0)) - after[-1]).max() > 0.005


def test_casadi_converts_nothing_in_a_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it does, it drops an interrupt that comes meanwhile."""
    control, converted = PairController(ARM, PAIRS[:3], backend="vm"), list[object]()
    control.reset(STATE)
    asked = vars(ca)["DM_from_array"]
    monkeypatch.setattr(ca, "DM_from_array", lambda value, *given: (converted.append(value), asked(value, *given))[1])
    # Its expressions are made once
    motion_cue(ARM, PAIRS[1], STATE, (0.1, 0.0, 0.0))
    assert converted
    converted.clear()
    control.command((0.1, 0.0, 0.0))
    control.switch("shoulder", 0.1)
    for _ in range(20):
        assert control.step(STATE).condition is Condition.REGULAR
        assert motion_cue(ARM, PAIRS[1], STATE, (0.1, 0.0, 0.0)).share == pytest.approx(1.0)
    assert not converted


def test_self_motion_after_a_drive_holds_the_tip_where_it_stops(control: PairController) -> None:
    control.command((0.1, 0.0, 0.0))
    q, _ = run(control, STATE, 60)
    seconds = control.switch("self", 0.5)
    q, _ = run(control, q, round(seconds / control.dt) + 2)
    control.command([0.05])
    where = place(q)
    elbow = place(q, "end3")
    q, rates = run(control, q, 400)
    assert np.abs(place(q) - where).max() < 1e-6
    assert np.abs(place(q, "end3") - elbow).max() > 0.05
    assert np.abs(rates[-1]).max() > 0.01


def test_prescribed_rates_of_constraints_are_exact(control: PairController) -> None:
    control.command((0.05, 0.0, 0.0))
    control.prescribe([0.04])
    q, rates = run(control, STATE, 40)
    assert abs(control.rates(q - control.dt * rates[-1])[ALPHA] @ rates[-1] - 0.04) < 1e-9


def test_bad_input_changes_nothing(control: PairController) -> None:
    control.command((0.1, 0.0, 0.0))
    for bad, error in (((0.1, 0.0), ShapeError), ("fast", ShapeError), ((0.1, 0.0, np.nan), NotFiniteError)):
        with pytest.raises(error):
            control.command(bad)
    with pytest.raises(UnknownNameError, match="did you mean 'plane'"):
        control.switch("plan")
    with pytest.raises(RangeError):
        control.switch("self", -1.0)
    assert control.active == "plane"
    assert control.step(STATE).v @ control.step(STATE).v > 0.0


def test_over_determined_commands_do_not_depend_on_the_unit_of_length() -> None:
    """Pose commanded while elbow point and pitch plane are held: three points give one answer in metres and in
    other units, plain rows do not.
    """
    robot = operator_arm("spdm_arm").robot
    xi, elbow = BodyRows("tip", name="xi"), BodyRows("end3", rotation=(), name="elbow")
    q = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
    found = {}
    for metric in (None, 0.5):
        for length in (1.0, 1000.0):
            pair = CoordinatePair(xi, elbow, metric=metric)
            control = PairController(robot, pair, limits=False, length=length, backend="vm")
            control.reset(q)
            control.command((0.01, 0.02, 0.0, 0.01, 0.0, 0.02))
            found[metric, length] = control.step(q).v
            assert np.abs(control.rates(q)[elbow] @ found[metric, length]).max() < 1e-9
    np.testing.assert_allclose(found[0.5, 1.0], found[0.5, 1000.0], atol=1e-5)
    assert np.abs(found[None, 1.0] - found[None, 1000.0]).max() > 1e-3


def test_hands_stay_while_the_body_turns() -> None:
    """15 joints: the body joint moves, both hands are held by their poses, within 2e-6 m after 4 s."""
    robot = parts("spdm").robot
    pair = next(p for p in mode_pairs("spdm", "M6") if p.name == "body_joint | hands")
    control = PairController(robot, pair, limits=False, backend="vm")
    arm = [0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9]
    q = start = np.concatenate(([0.2], arm, arm))
    control.reset(q)
    control.command([0.02])
    data = robot.model.createData()
    places = []
    for _ in range(200):
        q = q + control.dt * control.step(q).v
    for state in (start, q):
        pin.framesForwardKinematics(robot.model, data, state)
        places.append([data.oMf[robot.model.getFrameId(f"arm{k}_tip")].copy() for k in (1, 2)])
    for before, after in zip(*places, strict=True):
        assert np.linalg.norm(pin.log6(before.actInv(after)).vector) < 2e-6
    assert abs(q[robot.dofs("body_joint").start] - start[robot.dofs("body_joint").start] - 0.08) < 1e-6


def random_arm_of_pairs(seed: int) -> tuple[Robot, list[CoordinatePair]]:
    """An arm of six to eight joints, and pairs of which one to three coordinates of any kind are commanded at once."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, Drawn(joints=(6, 8), turned=True, kinds={"turning": 0.8, "sliding": 0.2}))
    kinds = (
        lambda: BodyRows("a_tip", expressed="world", translation=tuple(rng.permutation(3)[:2].tolist()), rotation=()),
        lambda: BodyRows("a_tip", translation=(), rotation=(0, 1, 2)),
        lambda: BodyRows("a3_link", "a1_link", "a2_link", translation=(0,), rotation=()),
        lambda: AxisRows("a4_link", tuple(rng.normal(size=3))),
        lambda: JointRows("a1"),
    )
    pairs = []
    for k in range(6):
        chosen = [kinds[j]() for j in rng.permutation(len(kinds))[: 2 + k % 2]]
        pairs.append(CoordinatePair(chosen[:2] if k % 3 else chosen[:3], JointRows("a5"), f"pair {k}"))
    return load(model), pairs


@pytest.mark.parametrize("name", ["ssrms", "panda", "spherical_4r", *(f"random {k}" for k in range(repeats(3)))])
def test_scaled_tasks_are_slowed_down_and_keep_their_direction(name: str) -> None:
    """Joints of 0.05 rad/s: random pairs, configurations and commands. What is met points along what is asked, and is
    all of it where that takes no joint to its limit; least squares turns it by tens of degrees.
    """
    if name.startswith("random"):
        robot, pairs = random_arm_of_pairs(int(name.split()[1]))
    else:
        robot, modes = parts(name).robot, [pair for mode in ("M1", "M2", "M3") for pair in mode_pairs(name, mode)]
        pairs = modes[:: 2 if name == "ssrms" else 1]
    robot = robot.with_limits(velocity=0.05)
    plain, scaled = (
        PairController(robot, pairs, limits=False, scaled=option, backend="vm") for option in (False, True)
    )
    rng, turned, slowed = np.random.default_rng(1), [], 0
    for pair in (pairs * repeats(30))[: repeats(30)]:
        q, rates = rng.uniform(-1.5, 1.5, robot.nq), rng.normal(size=row_count(robot, pair.task))
        for size in (1.0, 1e-3):
            steps, angles = [], []
            for control in (plain, scaled):
                control.switch(pair.name, 0.0)
                control.reset(q)
                control.command(size * 0.3 * rates / np.linalg.norm(rates))
                steps.append(control.step(q))
                met, asked = control.met(steps[-1].v), control.asked
                length = np.linalg.norm(met)
                angles.append(np.arccos(np.clip(met @ asked / length / np.linalg.norm(asked), -1.0, 1.0)))
            if plain.eased or pair.over_determined(robot) or steps[0].condition != "regular":
                continue
            if not any(abs(steps[0].v) > 0.05 - 1e-9):
                assert np.abs(steps[1].v - steps[0].v).max() < 1e-6
            elif length > 0.003 * size:
                turned.append(angles[0])
                assert angles[1] < 1e-2
                slowed += 1
    assert slowed >= 8
    assert max(turned) > 0.5


@pytest.mark.parametrize("name", ["ssrms", "spherical_4r", "panda"])
def test_the_status_of_a_step_is_what_the_adviser_says_of_the_pair_there(name: str) -> None:
    """Random configurations and such on a locus of a pair or near it: the same word, ``solved`` where it is regular."""
    robot = parts(name).robot
    pairs = [pair for mode in ("M1", "M2") for pair in mode_pairs(name, mode)][:6]
    control, adviser = PairController(robot, pairs, backend="vm"), Adviser(robot, pairs, exact=False, backend="vm")
    rng, seen = np.random.default_rng(2), []
    for k in range(repeats(36)):
        q = rng.uniform(-1.0, 1.0, robot.nq)
        if k % 3:
            # Wrists, elbows and planes lose their rank at quarter turns
            q[rng.integers(robot.nq)] = np.pi / 2 * rng.integers(-1, 2) + rng.choice([0.0, 0.004])
        q = np.clip(q, robot.limits.position_lower, robot.limits.position_upper)
        control.switch(pairs[k % len(pairs)].name, 0.0)
        control.reset(q)
        control.command(0.01 * rng.normal(size=len(control.asked)))
        step = control.step(q)
        said = next(one.condition for one in adviser.advise(q) if one.pair == control.active)
        assert step.condition is said
        assert step.ended == "solved"
        assert step.status == (said if said != "regular" else "solved")
        assert pickle.loads(pickle.dumps(step)).status == step.status
        seen.append(str(step.status))
    assert seen.count("solved") > 5
    assert len(seen) - seen.count("solved") > 3
