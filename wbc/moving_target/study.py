"""Many trials of one kind, and what came of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, product

import numpy as np

from wbc import validation
from wbc.estimation import DropoutPolicy
from wbc.moving_target.knowledge import Knowledge, Measurement
from wbc.moving_target.motions import TargetMotion, sea, swing, tumble
from wbc.moving_target.trial import HAND, WORK, Bench, TargetScenario, TargetTrial
from wbc.multibody import pin
from wbc.program import Approach, Guard, Move, PoseTarget, Program, Retreat, Wait
from wbc.robot import Robot
from wbc.simulation import Plant
from wbc.validation import Array

MOTIONS = ("sea", "tumble", "swing", "rest")
#: Significant heights of a sea along x, y, z [m] and about them [rad]
SIGNIFICANT = (0.04, 0.04, 0.06, 0.07, 0.07, 0.07)
#: Peak period of a sea [s]
PERIOD = 6.0
#: Of a tumble: rate [rad/s]
RATE = float(np.radians(3.0))
#: How long a tool has to be aligned before it goes in [s]
STEADY = 0.25
#: Speed of an object that tumbles [m/s]
DRIFT = 0.005
#: What ends every program
LOST = Guard(signal="lost", above=0.5)


@dataclass(frozen=True, eq=False)
class TargetStudy:
    """Trials of one scenario on one kind of motion.

    Attributes:
        scenario: what is done. motion: one of :data:`MOTIONS`. home: mean pose of the object. spread: of that pose from
            trial to trial [m, rad]. lever: from the object's centre of mass to its frame [m]. drift: of a tumbling
            object [m/s]. severity: what heights and rates are multiplied by.
    """

    scenario: TargetScenario
    motion: str
    home: pin.SE3
    spread: tuple[float, float]
    lever: float
    drift: float
    severity: float = 1.0

    def moves(self, seed: int) -> TargetMotion:
        """The motion of one trial."""
        rng = np.random.default_rng((seed, 0))
        place, turn = rng.uniform(-1.0, 1.0, (2, 3))
        mean = self.home * pin.SE3(pin.exp3(self.spread[1] * turn), self.spread[0] * place)
        if self.motion == "sea":
            return sea(mean, rng, self.severity * np.array(SIGNIFICANT), PERIOD)
        if self.motion == "tumble":
            s = self.scenario
            return tumble(mean, rng, self.severity * RATE, self.lever, self.drift, s.timeout + 1.0)
        moving = swing(mean)
        return moving if self.motion == "swing" else replace(moving, amplitude=0.0 * moving.amplitude)


@dataclass(frozen=True)
class Outcome:
    """Figures of the trials with one knowledge.

    Attributes:
        done: how many there were. successes: of them. rms, worst: of the position error while working [m]; medians over
            the trials, and the largest of those that succeeded. angle: largest error of the angle of those [rad].
            time: median and largest of those [s]. rate: largest joint rate, as a part of its limit.
        knowledge_rms: median over the trials of how wrong the known place of the goal was [m].
        reasons: why trials failed, and how often.
    """

    knowledge: str
    done: int
    successes: int
    rms: float
    worst: float
    angle: float
    time: tuple[float, float]
    rate: float
    knowledge_rms: float
    reasons: dict[str, int]


def peg(
    robot: Robot, tip: str, motion: str, clearance: float, measurement: Measurement, severity: float = 1.0
) -> TargetStudy:
    """A peg into a hole of 40 mm in a table below the tool, from 25 mm before it and out again, ``clearance`` all round
    [m].
    """
    tool = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.05]))
    goal = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.10, 0.05, -0.04]))
    touches, before = (Guard(signal="wall", below=0.0),), PoseTarget(position=(0, 0, -0.065), quaternion=(0, 0, 0, 1))
    aligned = Guard(signal="aside", below=0.75 * clearance, lasting=STEADY)
    slow, within = (0.06, 0.5), (5e-3, 0.02)
    program = Program(
        steps=(
            Move(hand=HAND, to=before, speed=slow, within=within, timeout=8),
            Wait(until=(aligned,), name="align", timeout=3),
            _approach(0.03, 0.038, 0.07, touches),
            Wait(until=(Guard(signal="elapsed", above=0.5),), name="stay", unless=touches),
            Retreat(hand=HAND, by=(0, 0, -0.065), speed=slow, within=within, unless=touches, timeout=5),
        ),
        abort=(LOST,),
    )
    scenario = TargetScenario(
        robot, tip, tool, robot.neutral, goal, program, lead=0.04, clearance=clearance, size=0.065, timeout=15.0,
        measurement=measurement,
    )  # fmt: skip
    return _placed(scenario, motion, np.array([0.0, 0.0, 0.12]), (0.03, 0.1), 0.15, severity)


def grasp(robot: Robot, tip: str, motion: str, measurement: Measurement, severity: float = 1.0) -> TargetStudy:
    """A grapple fixture on a free body, a twentieth of the arm's length before the tool: the tool comes within a
    fiftieth, goes on to the fixture and holds, within 20 mm and 1 degree.
    """
    length = robot.characteristic_length
    near, turned = 0.02 * length, Guard(signal="tilt", above=float(np.radians(1.0)))
    before = PoseTarget(position=(0, 0, -near), quaternion=(0, 0, 0, 1))
    aligned, off = Guard(signal="aside", below=0.01, lasting=STEADY), Guard(signal="off", above=0.02)
    program = Program(
        steps=(
            Move(hand=HAND, to=before, speed=(0.12, 0.03), within=(0.05, 0.02), timeout=20),
            Wait(until=(aligned,), name="align", timeout=10),
            _approach(0.1, -0.005, 1.05 * near, (turned,)),
            Wait(until=(Guard(signal="elapsed", above=1.0),), name="stay", unless=(off, turned)),
        ),
        abort=(LOST,),
    )
    scenario = TargetScenario(
        robot, tip, pin.SE3.Identity(), nimble(robot, tip, 0.05 * length), pin.SE3.Identity(), program, lead=0.0,
        clearance=0.02, size=near, timeout=40.0, rate=25.0, gain=2.0, measurement=measurement, process=(1e-3, 1e-3),
        policy=DropoutPolicy(1.0, 2.0),
    )  # fmt: skip
    return _placed(scenario, motion, np.array([0.0, 0.0, 0.05 * length]), (0.01 * length, 0.1), 1.0, severity)


def _approach(speed: float, depth: float, at_most: float, unless: tuple[Guard, ...]) -> Approach:
    """The step that goes in."""
    deep = (Guard(signal="depth", above=depth),)
    return Approach(hand=HAND, along=(0, 0, 1), speed=speed, until=deep, at_most=at_most, name=WORK, unless=unless)


def _placed(
    scenario: TargetScenario,
    motion: str,
    ahead: Array,
    spread: tuple[float, float],
    lever: float,
    severity: float,
) -> TargetStudy:
    """The object where its goal is ``ahead`` of the tool at first, in the tool's axes."""
    validation.one_of("motion", motion, MOTIONS)
    robot = scenario.robot
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, scenario.start)
    tool = data.oMf[robot.model.getFrameId(scenario.tip)] * scenario.tool
    home = tool * pin.SE3(np.eye(3), ahead) * scenario.goal.inverse()
    return TargetStudy(scenario, motion, home, spread, lever, DRIFT, severity)


def nimble(robot: Robot, tip: str, ahead: float, rate: float = RATE, seconds: float = 18.0) -> Array:
    """Of 2000 configurations within half the joints' ranges, or 1.5 rad, that from which the tip can turn at ``rate``
    about every one of 26 axes u with the smallest part of its joints' rate limits, while it goes ahead along its z axis
    in the first five seconds: with least-norm velocities

        dq/dt = J^+ (v; rate u),          the largest |dq/dt| / limit of all axes, joints and times.

    Only the 150 that are best at the first moment are followed over the time.
    """
    rng, model, data = np.random.default_rng(0), robot.model, robot.model.createData()
    reach = np.minimum((robot.limits.position_upper - robot.limits.position_lower) / 4, 1.5)
    frame, fastest = model.getFrameId(tip), robot.limits.velocity
    axes = np.array([u for u in product((-1.0, 0.0, 1.0), repeat=3) if any(u)])
    axes *= rate / np.linalg.norm(axes, axis=1)[:, None]

    def inverse(q: Array) -> Array:
        return np.linalg.pinv(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))

    def at_first(q: Array) -> float:
        return float((np.abs(inverse(q)[:, 3:] @ axes.T) / fastest[:, None]).max())

    def followed(q: Array, spin: Array) -> Iterator[float]:
        inverse(q)
        way = pin.updateFramePlacement(model, data, frame).rotation[:, 2] * ahead / 5.0
        for second in range(round(seconds)):
            v = inverse(q) @ np.concatenate([way * (second < 5), spin])
            yield float((np.abs(v) / fastest).max())
            q = pin.integrate(model, q, v)

    drawn = [pin.integrate(model, robot.neutral, reach * rng.uniform(-1.0, 1.0, robot.nv)) for _ in range(2000)]
    best, least = drawn[0], np.inf
    for q in sorted(drawn, key=at_first)[:150]:
        worst = 0.0
        for part in chain.from_iterable(followed(q, spin) for spin in axes):
            worst = max(worst, part)
            if worst >= least:
                break
        else:
            best, least = q, worst
    return np.array(best)


def trials(
    study: TargetStudy, runs: int, kinds: Iterable[Knowledge], *, plant: Plant | None = None, backend: str = "auto",
    told: Callable[[Knowledge, int, TargetTrial], None] | None = None, stop: Callable[[], bool] | None = None,
) -> dict[Knowledge, list[TargetTrial]]:  # fmt: skip
    """Trials 0 to ``runs`` with each knowledge, on the same motions; fewer where ``stop`` says so.

    Args:
        told: is called after each trial.

    Raises:
        WbcError: a bad scenario; PlantError from the plant.
    """
    bench, out = Bench(study.scenario, plant, backend), {kind: list[TargetTrial]() for kind in kinds}
    for seed in range(runs):
        motion = study.moves(seed)
        for kind, done in out.items():
            if stop is not None and stop():
                return out
            done.append(bench.run(motion, kind, np.random.default_rng((seed, 1))))
            if told is not None:
                told(kind, seed, done[-1])
    return out


def outcome(knowledge: Knowledge, done: list[TargetTrial]) -> Outcome:
    """The figures of some trials, at least one."""
    good = [trial for trial in done if trial.success]
    sizes = [np.linalg.norm(trial.error[trial.working, :3], axis=1) for trial in done]
    reasons: dict[str, int] = {}
    for trial in done:
        if not trial.success:
            reasons[trial.reason] = reasons.get(trial.reason, 0) + 1
    nan = float("nan")
    angles = [np.linalg.norm(trial.error[trial.working, 3:], axis=1).max() for trial in good]
    return Outcome(
        str(knowledge),
        len(done),
        len(good),
        float(np.median([np.sqrt(np.mean(size**2)) for size in sizes])),
        float(max((size.max() for size, trial in zip(sizes, done, strict=True) if trial.success), default=nan)),
        float(max(angles, default=nan)),
        (float(np.median([t.time for t in good])), max(t.time for t in good)) if good else (nan, nan),
        float(max(trial.rates.max() for trial in done)),
        float(np.median([np.sqrt(np.mean(np.sum(t.known[t.working, :3] ** 2, axis=1))) for t in done])),
        reasons,
    )
