"""The loop of torques under a walk: it follows rates, opens and closes hands, and meets faults."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.refusals import assert_refused
from tests.simulation.machines import HANDS, heavy
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.log import load
from wbc.robot import Robot
from wbc.robots import with_masses
from wbc.simulation import Command, CommandKind, Encoders, GripKind, KinematicPlant, Motors, PinocchioPlant
from wbc.walking import cylinder
from wbc.walking.torque.choice import PlantChoice
from wbc.walking.torque.faults import Fault
from wbc.walking.torque.loop import Gains, TorqueLoop
from wbc.walking.torque.stack import TorqueStack

ROBOT = heavy().robot


@cache
def stack() -> TorqueStack:
    return TorqueStack(heavy(), [GripKind.AXIS], backend="vm")


def begun(loop: TorqueLoop, hands: tuple[str, ...] = HANDS) -> TorqueLoop:
    loop.reset(ROBOT.neutral, 0.0)
    for hand in hands:
        loop.grasp(hand, ROBOT.pose(ROBOT.neutral, hand), GripKind.AXIS)
    return loop


def rates(size: float) -> np.ndarray:
    """Rates at which three closed hands stay: the body sinks, the joints follow from the hands' Jacobians."""
    down = np.array([0.0, 0.0, size, 0.0, 0.0, 0.0])
    rows = np.vstack([ROBOT.jacobian(ROBOT.neutral, hand) for hand in HANDS])
    joints = -np.linalg.lstsq(rows[:, 6:], rows[:, :6] @ down)[0]
    return np.concatenate([down, joints])


@pytest.mark.parametrize("delay", [0.0, 0.005])
def test_it_follows_the_rates_of_a_walk(delay: float) -> None:
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT, motors=Motors(delay=delay)), delay=delay))
    v = rates(0.02)
    for part in (0.5, 1.0, 1.0, 1.0):
        loop.apply(Command(CommandKind.VELOCITY, part * v))
        loop.advance(0.01)
    assert loop.read().v == pytest.approx(v, abs=0.25 * np.abs(v).max() if delay else 0.02 * np.abs(v).max())
    assert loop.watch.unsolved == 0
    assert loop.watch.drift < 1e-6
    assert 0.0 < loop.watch.force < loop.stack.rating.force
    assert loop.watch.figures()[0].value == loop.watch.drift


def test_friction_that_nobody_knows_is_compensated() -> None:
    """A wrist of 20 N m that rubs with 3 N m: with what the residual adds it moves, without it it stays behind."""
    wrist, off = ROBOT.dofs("arm3_joint4"), list[float]()
    for most in (8.0, 0.0):
        plant = PinocchioPlant(ROBOT, motors=Motors(coulomb=3.0, viscous=1.0))
        loop = begun(TorqueLoop(stack(), plant, Gains(friction=most)), HANDS[:2])
        v = np.zeros(ROBOT.nv)
        v[wrist] = 0.3
        for _ in range(12):
            loop.apply(Command(CommandKind.VELOCITY, v))
            loop.advance(0.01)
        off.append(abs(float(loop.read().v[wrist][0]) - 0.3))
        assert loop.failing() == ""
    assert off[0] < 0.01
    assert off[1] > 0.05


def turns_alone(loop: TorqueLoop, robot: Robot, joint: str, rate: float, ticks: int, within: float) -> None:
    """A joint of an open arm follows its command within some ticks; nothing else moves, and no hold is lost."""
    v = np.zeros(robot.nv)
    v[robot.dofs(joint)] = rate
    for _ in range(ticks):
        loop.apply(Command(CommandKind.VELOCITY, v))
        loop.advance(0.01)
    assert loop.read().v == pytest.approx(v, abs=within)
    assert loop.watch.drift < 1e-6


def test_an_opened_hand_moves_alone() -> None:
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT)))
    loop.release(HANDS[2])
    turns_alone(loop, ROBOT, "arm3_joint1", 0.1, 4, 0.01)
    assert set(loop.plant.grips) == set(HANDS[:2])  # type: ignore[attr-defined]


def test_faults_come_in_time_and_a_broken_hold_is_lost() -> None:
    faults = [Fault.read("break arm1 at 0.01"), Fault.read("slip arm2 0.001 at 0"), Fault.read("limp arm3_joint1 at 0")]
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT), faults=faults))
    loop.advance(0.01)
    assert loop.lost() == ()
    loop.advance(0.01)
    assert loop.lost() == (HANDS[0],)
    assert set(loop.plant.grips) == set(HANDS[1:])  # type: ignore[attr-defined]
    assert not loop.plant._state.scale[ROBOT.dofs("arm3_joint1")].any()  # type: ignore[attr-defined]
    assert loop.plant._state.slips  # type: ignore[attr-defined]


def test_texts_of_faults() -> None:
    assert Fault.read("slip arm2 0.005 at 4") == Fault("slip", "arm2", 0.005, 4.0)
    assert Fault.read("limp arm3_joint2 at 2.5") == Fault("limp", "arm3_joint2", 0.0, 2.5)
    assert Fault.read("delay 0.02") == Fault("delay", "", 0.02)
    for text in ("slip arm2 at 4", "limp arm3_joint2 0.1 at 2", "break arm1 4", "delay", "delay x"):
        assert_refused(lambda text=text: Fault.read(text), ShapeError, "expected")
    assert_refused(lambda: Fault.read("burn arm1 at 2"), UnknownNameError, "break")


def test_what_cannot_walk_under_torques_is_refused() -> None:
    assert_refused(lambda: TorqueStack(wbc.robots.walker(), [GripKind.AXIS]), RangeError, "masses")
    assert_refused(lambda: TorqueStack(heavy(), [GripKind.POSITION]), RangeError, "about the line through them")
    assert_refused(lambda: TorqueLoop(stack(), KinematicPlant(ROBOT)), ShapeError, "torques")
    assert_refused(lambda: wbc.robots.with_masses(wbc.robots.walker(two_ended=True)), ShapeError, "bodies with arms")
    assert_refused(lambda: PlantChoice("pinochio"), UnknownNameError, "pinocchio")
    assert_refused(lambda: PlantChoice(faults=("delay 0.02",)), RangeError, "kinematic")
    assert_refused(lambda: PlantChoice("pinocchio", faults=("delay 0.02", "delay 0.01")), RangeError, "one delay")
    choice, walker = PlantChoice("pinocchio", faults=("break arm9 at 1",)), wbc.robots.walker()
    assert_refused(lambda: choice.build(walker, cylinder(rigid=True)), UnknownNameError, "arm1")


@pytest.mark.parametrize("seed", range(5))
def test_why_holds_that_let_two_hands_tilt_are_refused(seed: int) -> None:
    """What two hands bear on the base has five directions where they may tilt, and six where they may only roll: none
    of the forces through both origins has a moment about the line between them.
    """
    q = pin.integrate(ROBOT.model, ROBOT.neutral, 0.3 * np.random.default_rng(seed).normal(size=ROBOT.nv))
    wrenches = [ROBOT.jacobian(q, hand)[:, :6].T for hand in HANDS[:2]]
    tilts = [w[:, 3:] @ ROBOT.pose(q, hand).rotation[:, :2] for w, hand in zip(wrenches, HANDS, strict=False)]
    forces = [w[:, :3] for w in wrenches]
    assert np.linalg.matrix_rank(np.hstack(forces), tol=1e-9) == 5
    assert np.linalg.matrix_rank(np.hstack([*forces, *tilts]), tol=1e-9) == 6


@cache
def four() -> TorqueStack:
    return TorqueStack(with_masses(wbc.robots.walker(4)), [GripKind.POSITION], backend="vm")


def test_four_arms_stand_on_holds_that_let_hands_tilt() -> None:
    robot = four().walker.robot
    hands, q = [arm.hand for arm in four().walker.arms], robot.neutral
    loop = TorqueLoop(four(), PinocchioPlant(robot))
    loop.reset(q, 0.0)
    for hand in hands:
        loop.grasp(hand, robot.pose(q, hand), GripKind.POSITION)
    assert loop.holds_without(hands[3])
    loop.release(hands[3])
    turns_alone(loop, robot, "arm4_joint1", 0.2, 6, 0.05)
    assert loop.watch.moment == 0.0
    assert not loop.holds_without(hands[2])
    assert "2 hands that may tilt on their holds do not keep the body from turning" in loop.failing()


def test_a_limp_motor_is_named_and_the_stack_does_without_it() -> None:
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT), faults=[Fault.read("limp arm3_joint2 at 0")]), HANDS[:2])
    swing = np.zeros(ROBOT.nv)
    swing[ROBOT.dofs("arm3_joint2")] = 0.3
    for _ in range(30):
        loop.apply(Command(CommandKind.VELOCITY, swing))
        loop.advance(0.01)
        if loop.failing():
            break
    assert "arm3_joint2 is limp" in loop.failing()
    assert [text for _, text in loop.watch.noted] == [loop.failing().rpartition(", seen")[0]]
    loop.advance(0.01)
    assert abs(loop.step.torque[ROBOT.dofs("arm3_joint2")]).max() < 1e-6
    begun(loop)
    assert loop.failing() == ""


def test_a_hand_that_closes_in_motion_is_named() -> None:
    loop, moving = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT)), HANDS[:2]), np.zeros(ROBOT.nv)
    moving[ROBOT.dofs("arm3_joint5")] = 0.05
    for _ in range(8):
        loop.apply(Command(CommandKind.VELOCITY, moving))
        loop.advance(0.01)
    loop.grasp(HANDS[2], ROBOT.pose(loop.read().q, HANDS[2]), GripKind.AXIS)
    ((_, text),) = loop.watch.noted
    assert text.startswith("arm3_hand closed with ")
    assert text.endswith(" and 0.05 rad/s")
    assert loop.failing() == ""


def test_a_hand_that_opens_late_does_so_with_its_torques() -> None:
    """Of 7 ms of delay the hand is held for 7 more, and the torques that it gets as it opens are those of a free one:
    its joints keep still, with 7 ms less they are thrown.
    """
    wrist = ROBOT.dofs("arm3_joint4").start
    plant = PinocchioPlant(ROBOT, motors=Motors(delay=0.007), gravity=(0.0, -0.5, 0.0))
    loop = begun(TorqueLoop(stack(), plant, delay=0.007))
    for _ in range(12):
        loop.advance(0.01)
    before = float(loop.step.torque[wrist])
    loop.release(HANDS[2])
    assert set(plant.grips) == set(HANDS)
    loop.advance(0.01)
    assert set(plant.grips) == set(HANDS[:2])
    assert abs(float(loop.step.torque[wrist]) - before) > 0.1
    assert abs(plant.state.v[ROBOT.base_nv :]).max() < 0.01


def test_a_payload_that_nobody_knows_is_borne() -> None:
    """30 kg on the body in 0.5 m/s^2: the residual of the body is its weight, and the stack bears it."""
    model = with_masses(wbc.robots.walker(), (0.0, 0.0, -0.5))
    payload = {"body": pin.Inertia(30.0, np.zeros(3), np.zeros((3, 3)))}
    plant = PinocchioPlant(model.robot, payloads=payload)
    loop = begun(TorqueLoop(TorqueStack(model, [GripKind.AXIS], backend="vm"), plant))
    for _ in range(25):
        loop.advance(0.01)
    assert loop._body.wrench[:3] == pytest.approx([0.0, 0.0, -15.0], abs=0.3)
    assert loop.read().q == pytest.approx(ROBOT.neutral, abs=2e-5)


def test_a_hand_that_slips_is_named() -> None:
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT), faults=[Fault.read("slip arm2 0.005 at 0")]))
    for _ in range(22):
        loop.advance(0.01)
    assert "arm2_hand has slipped by 1" in loop.failing()
    assert [text for _, text in loop.watch.noted][:1] == ["arm2_hand slips on its hold"]
    loads = loop.watch.loads()
    assert loads.force.shape == loads.moment.shape == loads.off.shape == (22, 3)
    assert loads.time[-1] == pytest.approx(0.22)
    # 5 mm are past; the grip of the hand is where it slipped to, it is off where it closed
    assert loads.off[-1, 1] == loop.watch.drift == np.nanmax(loads.off)
    assert loads.off[-1, 1] > 2e-3 > 1e-4 > loads.off[-1, 0]
    assert np.nanmax(loads.force) == loop.watch.force
    assert loads.noted == tuple(loop.watch.noted)


def test_loads_are_written_as_they_are(tmp_path: Path) -> None:
    loop = begun(TorqueLoop(stack(), PinocchioPlant(ROBOT)), HANDS[:2])
    loop.advance(0.01)
    file = loop.watch.loads().save(tmp_path)
    read = load(file)
    assert read.meta["rating"] == {"force": loop.stack.rating.force, "torque": loop.stack.rating.torque}
    assert np.isnan(read.array("force")[0]).tolist() == [False, False, True]
    assert read.units["moment.2"] == "N m"


def test_noisy_encoders_are_filtered() -> None:
    """A still robot is read with noise: the filter's joints keep a third of it, with friction that nobody knows."""
    noise = Encoders(position=1e-4, velocity=1e-3)
    plant = PinocchioPlant(ROBOT, encoders=noise, motors=Motors(viscous=0.5), seed=1)
    loop, off = begun(TorqueLoop(stack(), plant, encoders=noise)), list[np.ndarray]()
    for _ in range(12):
        loop.advance(0.01)
        off.append(np.stack([loop.read().q[7:], plant.read().q[7:]]) - plant.state.q[7:])
    kept, read = np.std(np.array(off[4:]), axis=(0, 2))
    assert read == pytest.approx(1e-4, rel=0.15)
    assert kept < read / 3.0
    assert loop.watch.unsolved == 0


def test_it_goes_on_with_a_velocity() -> None:
    faults = [Fault.read("break arm1 at 1"), Fault.read("limp arm3_joint1 at 1")]
    loop, v = TorqueLoop(stack(), PinocchioPlant(ROBOT), faults=faults), rates(0.02)
    loop.reset(ROBOT.neutral, 2.0)
    loop.move(v)
    for hand in HANDS:
        loop.grasp(hand, ROBOT.pose(ROBOT.neutral, hand), GripKind.AXIS)
    assert loop.read().v == pytest.approx(v, abs=1e-3 * np.abs(v).max())
    loop.advance(0.01)
    # The hold broke before it went on, the motor is still dead
    assert loop.lost() == ()
    assert not loop.plant._state.scale[ROBOT.dofs("arm3_joint1")].any()  # type: ignore[attr-defined]
