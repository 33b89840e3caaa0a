"""Programs of steps: what they do, how they end, and that hands never jump."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.errors import NotFiniteError, RobotFileError, ShapeError, UnknownNameError
from wbc.program import (
    Activate,
    Alternatives,
    Approach,
    Event,
    Grasp,
    Guard,
    HandReference,
    Move,
    Operate,
    PoseTarget,
    Program,
    ProgramError,
    Release,
    Report,
    Retreat,
    Runner,
    Wait,
)
from wbc.program.hand import ACCELERATION

DT = 0.02
START = np.array([0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.7])


@pytest.fixture(scope="module")
def compiled() -> wbc.Controller:
    stack = wbc.Stack(wbc.robots.load("panda"), dt=DT)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp", gain=20.0), name="hand")
    stack.add(wbc.tasks.EndEffector("panda_link4", kind="position"), name="elbow", weight=0.0)
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits())
    return stack.compile()


@pytest.fixture
def controller(compiled: wbc.Controller) -> wbc.Controller:
    return compiled.clone()


class Fingers:
    """A gripper that needs some ticks, and may find nothing to hold."""

    def __init__(self, holds: bool = True) -> None:
        self.state, self.holds = "open", holds

    def close(self) -> None:
        self.state = "closed" if self.holds else "empty"

    def open(self) -> None:
        self.state = "open"


class Loop:
    """A robot that does what it is told, over a spring at a height."""

    def __init__(self, program: Program, controller: wbc.Controller, floor: float = 0.3, **grippers: Fingers) -> None:
        self.runner, self.controller = Runner(program, controller, grippers=grippers), controller
        self.q, self.floor, self.force = START.copy(), floor, 0.0
        self.robot = controller.stack.robot
        self.item = controller.stack["hand"].item

    @property
    def hand(self) -> pin.SE3:
        return self.item.initial(self.robot, self.q)["target"]

    def tick(self) -> Report:
        twists = {name: hand.reference.twist for name, hand in self.runner.hands.items()}
        self.force = max(0.0, 3000.0 * (self.floor - float(self.hand.translation[2])))
        report = self.runner.tick(self.q, {"force": self.force})
        for name, hand in self.runner.hands.items():
            change = np.abs(hand.reference.twist - twists[name]) / DT
            assert change[:3].max() <= ACCELERATION[0] * 1.001
            assert change[3:].max() <= ACCELERATION[1] * 1.2, "turning axes add the centripetal part"
        self.q = pin.integrate(self.robot.model, self.q, self.controller.step(self.q).v * DT)
        return report

    def run(self, ticks: int = 1500) -> Report:
        for _ in range(ticks):
            report = self.tick()
            if report.state != "running":
                return report
        raise AssertionError(f"still {report}")

    def words(self) -> list[tuple[str, str]]:
        return [(event.step, event.status) for event in self.runner.log]


DOWN = Approach("hand", (0.0, 0.0, -1.0), speed=0.05, until=(Guard("force", above=5.0),), at_most=0.3)


def test_a_program_from_a_file_is_carried_out(controller: wbc.Controller, tmp_path: Path) -> None:
    path = tmp_path / "pick.yaml"
    path.write_text(
        """
steps:
  - {step: move, hand: hand, to: {position: [0.5, 0.1, 0.4]}, timeout: 10}
  - {step: approach, hand: hand, along: [0, 0, -1], speed: 0.05, until: [{signal: force, above: 5}], at_most: 0.3}
  - {step: grasp, gripper: fingers, timeout: 2}
  - {step: retreat, hand: hand, by: [0, 0, -0.1]}
  - {step: hold, until: [{signal: elapsed, above: 0.5}]}
abort: [{signal: force, above: 100}]
"""
    )
    loop = Loop(Program.read(path), controller, fingers=Fingers())
    touched = 0.0
    while (report := loop.tick()).state == "running":
        touched = max(touched, loop.force)
    assert report.state == "succeeded"
    assert 5.0 < touched < 15.0, "the hand stops where it touches"
    ends = [step.split()[1] for step, status in loop.words() if status == "done"]
    assert ends == ["move", "approach", "grasp", "retreat", "hold"]
    np.testing.assert_allclose(loop.hand.translation, [0.5, 0.1, 0.3] - 0.1 * loop.hand.rotation[:, 2], atol=4e-3)
    loop.runner.save(tmp_path / "log.jsonl")
    events = [Event(**json.loads(line)) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert events == loop.runner.log
    assert "retreat [✓]" in loop.runner.picture()


def test_alternatives_are_tried_in_turn(controller: wbc.Controller) -> None:
    nothing = Approach("hand", (1.0, 0.0, 0.0), speed=0.1, until=(Guard("force", above=5.0),), at_most=0.03)
    steps = (
        Alternatives(((nothing, Grasp("fingers")), (Move("hand", PoseTarget((0.5, 0.0, 0.45))),))),
        Release("fingers"),
    )
    loop = Loop(Program(steps), controller, fingers=Fingers())
    assert loop.run().state == "succeeded"
    assert loop.words()[1] == ("steps.0.0.0 approach", "failed")
    assert ("steps.0.1.0 move", "done") in loop.words()
    assert not any("grasp" in step for step, _ in loop.words())


@pytest.mark.parametrize(
    ("step", "reason"),
    [
        (Move("hand", PoseTarget((0.5, 0.3, 0.4)), timeout=0.3), "not done after 0.3 s, the hand is"),
        (Grasp("fingers", timeout=0.5), "not done after 0.5 s, the gripper is empty"),
        (Approach("hand", (0, 0, 1), until=(Guard("force", above=5),), at_most=0.02), "nothing was met within 0.02 m"),
        (Wait(until=(Guard("force", above=1e9),), unless=(Guard("elapsed", above=0.4),)), "elapsed above 0.4"),
    ],
)
def test_failures_say_why_and_the_recovery_follows(controller: wbc.Controller, step: Move, reason: str) -> None:
    back = Retreat("hand", (0.0, 0.0, -0.02))
    loop = Loop(Program((step,), recovery=(back,)), controller, fingers=Fingers(holds=False))
    assert loop.run().state == "failed"
    failed = next(event for event in loop.runner.log if event.status == "failed")
    assert failed.reason.startswith(reason)
    assert loop.words()[-1] == ("recovery.0 retreat", "done")


def test_an_abort_stops_the_hand_and_a_dead_sensor_aborts(controller: wbc.Controller) -> None:
    for value in (50.0, math.nan):
        loop = Loop(
            Program((Move("hand", PoseTarget((0.3, 0.3, 0.6))),), abort=(Guard("force", above=20),)), controller
        )
        for _ in range(30):
            loop.tick()
        assert np.linalg.norm(loop.runner.hands["hand"].reference.twist) > 0.05
        assert loop.runner.tick(loop.q, {"force": value}).state == "aborted"
        for _ in range(60):
            loop.tick()
        assert loop.runner.report.state == "aborted"
        assert np.linalg.norm(loop.runner.hands["hand"].reference.twist) < 1e-12
        assert ("force has no value" in loop.runner.report.reason) == math.isnan(value)


def test_a_dead_sensor_ends_no_approach(controller: wbc.Controller) -> None:
    loop = Loop(Program((DOWN,)), controller)
    loop.tick()
    for _ in range(10):
        assert loop.runner.tick(loop.q, {"force": math.nan}).state == "running"


def test_pauses_freeze_the_program_and_single_steps_end_in_one(controller: wbc.Controller) -> None:
    steps = (Move("hand", PoseTarget((0.5, 0.1, 0.4)), timeout=4.0), Retreat("hand", (0.0, 0.02, 0.0)), DOWN)
    loop = Loop(Program(steps), controller)
    loop.runner.resume(single=True)
    for _ in range(20):
        loop.tick()
    loop.runner.pause()
    time, here = loop.runner.time, 0.0
    for k in range(40):
        assert loop.tick().state == "paused"
        here = float(np.linalg.norm(loop.runner.hands["hand"].reference.twist)) if k > 30 else here
    assert here < 1e-12
    assert loop.runner.time == time
    loop.runner.resume(single=True)
    assert loop.run().state == "paused"
    assert loop.words()[-1] == ("steps.0 move", "done")
    loop.runner.resume(single=True)
    loop.run()
    assert loop.words()[-1] == ("steps.1 retreat", "done")
    loop.runner.resume()
    assert loop.run().state == "succeeded"


def test_an_operator_moves_the_hand_until_the_twist_is_old(controller: wbc.Controller) -> None:
    step = Operate("hand", (Guard("elapsed", above=3.0),), speed=(0.05, 0.3), stale=0.2)
    loop, fastest = Loop(Program((step,)), controller), []
    for k in range(200):
        if k < 50:
            loop.runner.operate("hand", [0.0, 0.4, 0.3, 0.0, 0.0, 0.0])
        if loop.tick().state != "running":
            break
        fastest.append(np.linalg.norm(loop.runner.hands["hand"].reference.twist[:3]))
    assert max(fastest) == pytest.approx(0.05, rel=1e-3), "scaled, in the same direction"
    assert fastest[110] < 1e-12
    assert loop.runner.report.state == "succeeded"


def test_weights_change_and_a_hand_that_wakes_up_stands_where_it_is(controller: wbc.Controller) -> None:
    controller["elbow"].weight = 0.0
    steps = (
        Move("hand", PoseTarget((0.5, 0.1, 0.4))),
        Activate({"elbow": 1e-3}, seconds=0.1),
        Retreat("elbow", (0.0, 0.0, 0.0)),
    )
    loop = Loop(Program(steps), controller)
    loop.runner.tick(loop.q, {})
    began = loop.runner.hands["elbow"].pose().translation
    assert loop.run().state == "succeeded"
    assert controller["elbow"].weight == pytest.approx(1e-3)
    target = loop.runner.hands["elbow"].reference.pose.translation
    assert np.linalg.norm(target - began) > 0.02
    np.testing.assert_allclose(target, loop.runner.hands["elbow"].pose().translation, atol=1e-3)


def test_guards_have_to_last(controller: wbc.Controller) -> None:
    program = Program((Wait((Guard("force", above=1.0, lasting=0.1),)),))
    runner = Runner(program, controller)
    for k in range(40):
        assert runner.tick(START, {"force": 2.0 * (k % 5 != 0)}).state == "running"
    for _ in range(6):
        report = runner.tick(START, {"force": 2.0})
    assert report.state == "succeeded"


def test_references_never_jump_whatever_is_asked_of_them() -> None:
    rng = np.random.default_rng(0)
    reference = HandReference(pin.SE3.Random(), DT)
    before = reference.twist
    for k in range(250):
        if rng.random() < 0.08:
            what = rng.integers(4)
            speed = (float(rng.uniform(0.02, 0.5)), float(rng.uniform(0.1, 2.0)))
            if what == 0:
                reference.stop()
            elif what == 1:
                reference.drift(rng.normal(size=6), speed)
            else:
                turn = pin.exp3(rng.normal(size=3))
                goal = pin.SE3(reference.pose.rotation @ turn, reference.pose.translation + rng.normal(size=3))
                reference.aim(goal, speed)
        pose = reference.pose
        reference.tick()
        moved = pin.log6(pose.actInv(reference.pose)).vector / DT
        own = np.concatenate([pose.rotation.T @ part for part in (0.5 * (before + reference.twist)).reshape(2, 3)])
        np.testing.assert_allclose(moved[3:], own[3:], atol=0.06, err_msg="the twist is the rate of the pose")
        np.testing.assert_allclose(
            (reference.pose.translation - pose.translation) / DT, 0.5 * (before + reference.twist)[:3], atol=5e-3
        )
        assert np.abs(reference.twist - before)[:3].max() <= ACCELERATION[0] * DT * 1.001, k
        before = reference.twist


def test_a_straight_move_is_straight_and_as_fast_as_it_may_be() -> None:
    reference, goal = HandReference(pin.SE3.Identity(), DT), np.array([0.4, -0.2, 0.1])
    turn = np.array([0.3, -1.0, 0.5])
    reference.aim(pin.SE3(pin.exp3(turn), goal), (0.1, 0.4))
    fastest = 0.0
    while not reference.arrived:
        reference.tick()
        p, x = reference.pose.translation, pin.log3(reference.pose.rotation)
        assert np.linalg.norm(np.cross(p, goal)) < 1e-9
        assert np.linalg.norm(np.cross(x, turn)) < 1e-9
        fastest = max(fastest, float(np.linalg.norm(reference.twist[:3])))
    np.testing.assert_allclose(reference.pose.homogeneous, pin.SE3(pin.exp3(turn), goal).homogeneous, atol=1e-12)
    assert fastest <= 0.1 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Move("hand"), "Move.to: field required"),
        (lambda: Guard("force"), "Guard: expected either above or below"),
        (lambda: Guard("force", above=math.nan), "Guard.above"),
        (lambda: Move("hand", PoseTarget(quaternion=(1, 1, 0, 0))), "length 1"),
        (lambda: Approach("hand", (0, 0, 0), until=(Guard("f", above=1),)), "expected a direction"),
        (lambda: Program(steps=[{"step": "moev"}]), r"Program.steps.0.step: unknown step \(got 'moev'\); valid: move"),
        (
            lambda: Program(steps=[{"step": "grasp", "griper": "g"}]),
            "steps.0.grasp.griper: unknown field",
        ),
        (lambda: Grasp("g", timout=1), r"Grasp.timout: unknown field \(got 1\); valid: timeout"),
        (lambda: Grasp("g", timeout=-1), "Grasp.timeout"),
        (lambda: Program(()), "Program.steps"),
    ],
)
def test_bad_programs_are_refused_by_place(make: object, message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        make()  # type: ignore[operator]


def test_bad_files_and_names_are_refused(controller: wbc.Controller, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError):
        Program.read(tmp_path / "none.yaml")
    for text, error in (("steps: [", RobotFileError), ("- 1", ProgramError), ("stps: []", ProgramError)):
        (tmp_path / "bad.yaml").write_text(text)
        with pytest.raises(error):
            Program.read(tmp_path / "bad.yaml")
    with pytest.raises(UnknownNameError, match="did you mean 'hand'"):
        Runner(Program((Retreat("hnad", (0, 0, 0)),)), controller)
    with pytest.raises(ShapeError, match="EndEffector"):
        Runner(Program((Retreat("posture", (0, 0, 0)),)), controller)
    with pytest.raises(UnknownNameError, match="gripper"):
        Runner(Program((Grasp("fingers"),)), controller)
    with pytest.raises(UnknownNameError, match="weights"):
        Runner(Program((Activate({"hnad": 1.0}),)), controller)
    runner = Runner(Program((DOWN,)), controller)
    with pytest.raises(UnknownNameError, match="signals"):
        runner.tick(START, {"forse": 1.0})
    with pytest.raises(NotFiniteError):
        runner.tick(np.full(7, np.nan), {"force": 1.0})
    with pytest.raises(ShapeError):
        runner.operate("hand", [1.0])
    assert runner.log == []
