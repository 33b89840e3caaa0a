"""Limbs of another kind: three UR5 solved by damped least squares are planned for, and walk, as three PUMA are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.robot import DHRow
from wbc.robots import Margins, Walker, WalkerArm, WalkerData
from wbc.robots.link_tree import TreeLink, build_model
from wbc.robots.walker_arms import BODY, chain
from wbc.validation import Array
from wbc.walking import Hold, PlaneSurface, Structure, cylinder
from wbc.walking.arms.angles import wrapped
from wbc.walking.arms.puma import ArmKinematics, limb_of
from wbc.walking.body_path import BodyPath, grid_path, straight_path
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.grips.conflicts import LimbShapes
from wbc.walking.planner.grips.table import Grips, find_grips
from wbc.walking.planner.plan import Plan
from wbc.walking.planner.planner import plan_walk

#: UR5 by its published rows: a, alpha, d
ROWS = (
    (0.0, pi / 2, 0.089159),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, pi / 2, 0.10915),
    (0.0, -pi / 2, 0.09465),
    (0.0, 0.0, 0.0823),
)
LIMIT, RATE, ACCELERATION = 2 * pi, pi, 12.0
HEIGHT = 0.5


@dataclass(frozen=True)
class NumericLimb:
    """Any arm of six joints whose first turns about its base's z axis and whose last about that of its hand.

    Attributes:
        placements: of joint k in the frame of joint k - 1 at 0, and of the hand in that of the last one ``[7, 4, 4]``.
        seeds: postures from which the branches are looked for ``[branches, 6]`` [rad].
    """

    placements: Array
    seeds: Array

    links: ClassVar[tuple[tuple[int, int], ...]] = ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6))
    radii: ClassVar[tuple[float, ...]] = (0.05,) * 6
    limit_names: ClassVar[tuple[str, ...]] = tuple(f"joint {k} limit" for k in range(1, 7))
    position_limits: ClassVar[tuple[float, ...]] = (LIMIT,) * 6
    joint_rates: ClassVar[tuple[float, ...]] = (RATE,) * 6
    joint_accelerations: ClassVar[tuple[float, ...]] = (ACCELERATION,) * 6
    still: ClassVar[int] = 1
    guided: ClassVar[int] = 0
    hand_length: ClassVar[float] = 0.0823
    hand_span: ClassVar[float] = 0.425 + 0.39225 + 0.10915 + 0.09465 + 0.0823
    waiting: ClassVar[tuple[tuple[float, float, float], ...]] = ()
    closed_form: ClassVar[None] = None

    @classmethod
    def of(cls, model: pin.Model, seeds: Array) -> NumericLimb:
        """From a model of Pinocchio; the hand is its last frame."""
        ends = [*list(model.jointPlacements)[1:], model.frames[model.nframes - 1].placement]
        return cls(np.array([end.homogeneous for end in ends]), seeds)

    @property
    def pivot(self) -> Array:
        return np.array([0.0, 0.0, ROWS[0][2]])

    def frames(self, q: Array) -> Array:
        """Of the joints, turned, and of the hand ``[..., 7, 4, 4]``."""
        here, out = np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4)), []
        for k in range(6):
            turn = np.zeros((*q.shape[:-1], 4, 4))
            c, s = np.cos(q[..., k]), np.sin(q[..., k])
            turn[..., 0, 0], turn[..., 0, 1], turn[..., 1, 0], turn[..., 1, 1] = c, -s, s, c
            turn[..., 2, 2] = turn[..., 3, 3] = 1.0
            here = here @ self.placements[k] @ turn
            out.append(here)
        return np.stack([*out, here @ self.placements[6]], axis=-3)

    def points(self, q: Array) -> Array:
        return np.ascontiguousarray(self.frames(q)[..., :3, 3])

    def margins(self, q: Array) -> Array:
        return np.asarray(LIMIT - np.abs(q))

    def wrist_of(self, points: Array, axes: Array) -> Array:
        return np.asarray(points - self.hand_length * axes)

    def wrist_reach(self, wrists: Array) -> Array:
        return np.asarray(self.hand_span - self.hand_length - np.linalg.norm(wrists - self.pivot, axis=-1))

    def wrist_bend(self, q: Array) -> Array:
        return np.abs(np.sin(q[..., 4]))

    def elbow_bend(self, q: Array) -> Array:
        return np.abs(q[..., 2])

    def held(self, points: Array, axes: Array, x: Array | None = None) -> tuple[Array, np.ndarray]:
        found = []
        for seed, hand in zip(self.seeds, self.points(self.seeds)[:, -1], strict=True):
            # From a posture that is turned towards the hold
            q = np.repeat(seed[None], len(points), axis=0)
            q[:, 0] += np.arctan2(points[:, 1], points[:, 0]) - np.arctan2(hand[1], hand[0])
            found.append(self._solved(q, points, axes, x))
        return wrapped(np.stack([q for q, _ in found], axis=1)), np.stack([there for _, there in found], axis=1)

    def follow(self, frames: Array, places: Array, guide: Array, margins: Margins) -> tuple[Array, np.ndarray]:
        turn, origin = frames[..., :3, :3], frames[..., :3, 3]
        points = np.einsum("mnji,mnj->mni", turn, places - origin)
        q = np.zeros((*guide.shape[:2], 6))
        q[..., : guide.shape[2]] = guide
        # The posture between those of the two grips, and from there the nearest that has the hand in place
        out, there = self._solved(q.reshape(-1, 6), points.reshape(-1, 3), None, None, 12)
        out, there = out.reshape(q.shape), there.reshape(q.shape[:2])
        smooth = np.abs(np.diff(out, axis=1)).max(axis=(1, 2), initial=0.0) < 0.6
        room = (LIMIT - np.abs(out)).min(axis=(1, 2)) > margins.swing_angle
        return out[..., : guide.shape[2]], there.all(axis=1) & smooth & room

    def _solved(
        self, q: Array, points: Array, axes: Array | None, x: Array | None, steps: int = 40
    ) -> tuple[Array, np.ndarray]:
        """By damped least squares from postures ``[m, 6]``; without ``x`` joint 6 stays."""
        q, there = q.copy(), np.zeros(len(q), dtype=bool)
        near = np.linalg.norm(points - self.pivot, axis=1) <= self.hand_span
        count = 6 if x is not None else 5
        for _ in range(steps):
            left = np.nonzero(~there & near)[0]
            if not len(left):
                break
            frames = self.frames(q[left])
            hand, z, at = frames[:, 6], frames[:, :6, :3, 2], frames[:, :6, :3, 3]
            jacobian, error = np.cross(z, hand[:, None, :3, 3] - at), points[left] - hand[:, :3, 3]
            if axes is not None:
                turning = np.cross(hand[:, :3, 2], axes[left])
                if x is not None:
                    across = x[left] - (x[left] * axes[left]).sum(axis=1)[:, None] * axes[left]
                    across /= np.linalg.norm(across, axis=1)[:, None]
                    turning = turning + np.cross(hand[:, :3, 0], across)
                    turning = 0.5 * (turning + np.cross(hand[:, :3, 1], np.cross(axes[left], across)))
                else:
                    # How it turns about its own axis is left open
                    own = hand[:, None, :3, 2]
                    z = z - (z * own).sum(axis=2, keepdims=True) * own
                jacobian, error = np.concatenate([jacobian, z], axis=2), np.concatenate([error, turning], axis=1)
            there[left] = np.linalg.norm(error, axis=1) < 1e-7
            if axes is not None:
                there[left] &= (hand[:, :3, 2] * axes[left]).sum(axis=1) > 0.0
            j = np.swapaxes(jacobian, 1, 2)[:, :, :count]
            normal = j @ np.swapaxes(j, 1, 2) + 1e-6 * np.eye(j.shape[1])
            step = np.einsum("mij,mi->mj", j, np.linalg.solve(normal, error[..., None])[..., 0])
            q[left[~there[left]], :count] += np.clip(step, -0.4, 0.4)[~there[left]]
        return q, there


def numeric_walker() -> Walker:
    """A body with three such arms, 0.3 m from its middle."""
    rows = [DHRow(a, alpha, d, lower=-LIMIT, upper=LIMIT, velocity=RATE) for a, alpha, d in ROWS]
    seeds = np.array([[0.28, 3.0, 1.56, 0.15, 1.57, 0.0], [0.28, 3.05, 2.01, 2.8, -1.57, 0.0]])
    limb, arms, links = NumericLimb.of(wbc.robots.from_dh(rows).model, seeds), list[WalkerArm](), list[TreeLink]()
    for k in range(3):
        name, out = f"arm{k + 1}", pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
        base = pin.SE3(pin.utils.rotate("z", 2 * pi * k / 3), np.zeros(3)) * out
        links += [TreeLink(f"{name}_base", BODY, base), *chain(name, f"{name}_base", rows, f"{name}_hand")]
        joints = tuple(f"{name}_joint{j}" for j in range(1, 7))
        some = slice(7 + 6 * k, 13 + 6 * k), slice(6 + 6 * k, 12 + 6 * k)
        arms.append(WalkerArm(name, base, joints, *some, f"{name}_base", f"{name}_hand", ()))
    neutral = {joint: value for arm in arms for joint, value in zip(arm.joints, seeds[0].tolist(), strict=True)}
    model = build_model("three_ur5", BODY, links)
    robot = wbc.robots.load(model, base="floating", neutral=neutral, acceleration=ACCELERATION)
    data = WalkerData.read(clearance=0.01, lift_height=0.07, exempt_distance=0.08)
    margins = Margins.of_reach(0.81725)
    return Walker(robot, tuple(arms), 2, data, tuple(links), limb=limb, margins=margins)


@pytest.fixture(scope="module")
def numeric() -> Walker:
    return numeric_walker()


@pytest.fixture(scope="module")
def floor() -> Structure:
    down = np.diag([1.0, -1.0, -1.0])
    holds = [
        Hold(f"{i},{j}", pin.SE3(down, np.array([0.2 * i, 0.2 * j, 0.0]))) for i in range(-4, 10) for j in range(-3, 4)
    ]
    return Structure("floor", tuple(holds), surface=PlaneSurface(pin.SE3.Identity()))


@pytest.fixture(scope="module")
def path() -> BodyPath:
    down = np.diag([1.0, -1.0, -1.0])
    return straight_path([pin.SE3(down, np.array([x, 0.0, HEIGHT])) for x in (0.0, 1.1)], 0.16)


@pytest.fixture(scope="module")
def plan(numeric: Walker, floor: Structure, path: BodyPath) -> Plan:
    return plan_walk(numeric, floor, path)


@pytest.fixture(scope="module")
def grips(plan: Plan) -> Grips:
    """All that the planner chose from."""
    assert plan.grips is not None
    return plan.grips


def test_grips_are_postures_on_their_holds(numeric: Walker, floor: Structure, path: BodyPath, grips: Grips) -> None:
    limb = numeric.limb
    assert limb is not None
    assert set(grips.arm.tolist()) == {0, 1, 2}
    assert len(set(grips.branch.tolist())) == 2
    rng = np.random.default_rng(0)
    for grip in rng.integers(0, len(grips), 60).tolist():
        sample = int(rng.integers(grips.first[grip], grips.last[grip] + 1))
        q, hold = grips.posture_at(grip, sample), int(grips.hold[grip])
        base = path.poses[sample] @ numeric.arms[grips.arm[grip]].base.homogeneous
        hand = base[:3, :3] @ limb.points(q)[-1] + base[:3, 3]
        np.testing.assert_allclose(hand, floor.positions[hold], atol=1e-6)
        # The hand's axis: from its wrist, one length of the hand behind it
        local = base[:3, :3].T @ (floor.positions[hold] - base[:3, 3])
        wrist = limb.wrist_of(local, base[:3, :3].T @ floor.axes[hold])
        np.testing.assert_allclose(limb.points(q)[-1] - limb.points(q)[-2], local - wrist, atol=1e-6)
    steps = np.abs(np.diff(grips.postures, axis=0)).max(axis=1)
    inside = np.ones(len(steps), dtype=bool)
    inside[grips.offset[1:] - 1] = False
    assert steps[inside].max() <= numeric.margins.held_rate * RATE * path.spacing + 1e-9


def test_a_plan_is_found_and_its_swings_are_clear(
    numeric: Walker, floor: Structure, path: BodyPath, grips: Grips, plan: Plan
) -> None:
    assert plan.complete
    assert len(plan.regrasps) >= 3
    shapes, names = LimbShapes(numeric), [arm.name for arm in numeric.arms]
    used = [0, 0, 0]
    for step, law in zip(plan.regrasps, plan.laws, strict=True):
        arm = names.index(step.arm)
        source, target = plan.chain[arm][used[arm] : used[arm] + 2]
        assert law.possible
        ends = floor.positions[[floor.index(step.source), floor.index(step.target)]]
        np.testing.assert_allclose(law.places[[0, -1]], ends, atol=1e-6)
        # On its way the hand is above the floor, and its joints, which follow it, keep to their rates
        assert law.places[len(law.places) // 2, 2] > numeric.arm_data.lift_height
        latch = numeric.arm_data.latch_time
        times = np.linspace(0.0, law.duration, 60)
        samples = (step.lift + (step.land - step.lift) * (latch + times) / (law.duration + 2 * latch + 0.06)) / 0.05
        aims = [law.at(float(time)) for time in times]
        part = np.array([aim.blend for aim in aims])[None, :, None]
        first, last = (plan.grips.between(np.array([[grip]]), samples[None]) for grip in (source, target))
        frames = path.blended(samples[None]) @ numeric.arms[arm].base.homogeneous
        places = np.array([aim.position for aim in aims])[None]
        assert numeric.limb is not None
        q, there = numeric.limb.follow(frames, places, first + part * (last - first), numeric.margins)
        assert there.all()
        assert np.abs(np.diff(q[0], axis=0)).max() / times[1] <= RATE * 1.02
        used[arm] += 1
    # Hands that hold keep their distance at every sample
    for sample in range(0, len(path), 4):
        held = [_held(plan, names, k, sample) for k in range(3)]
        points = [shapes.points(k, plan.grips.posture_at(g, sample))[None] for k, g in enumerate(held)]
        assert all(shapes.between(points[a], points[b])[0] > -1e-9 for a, b in ((0, 1), (0, 2), (1, 2)))


def _held(plan: Plan, names: list[str], arm: int, sample: int) -> int:
    """The grip of an arm at a sample; while it swings the one that lasts."""
    mine = [step for step in plan.regrasps if step.arm == names[arm] and step.land <= sample * 0.05]
    return plan.chain[arm][len(mine)]


def test_the_plan_is_carried_out(numeric: Walker, floor: Structure, path: BodyPath, plan: Plan) -> None:
    walk = Walk(numeric, floor, plan, stack=WalkStack(numeric, floor, collisions=False))
    assert walk.run() == "arrived"
    assert [event.hold for event in walk.events if event.what == "land"] == [step.target for step in plan.regrasps]
    np.testing.assert_allclose(walk.q[:3], path.poses[-1, :3, 3], atol=1e-4)
    assert walk.time < path.duration + 1.0


def test_the_walkers_own_limb_is_taken(numeric: Walker) -> None:
    assert limb_of(numeric) is numeric.limb
    assert limb_of(wbc.robots.walker()) == ArmKinematics()
    wide = replace(wbc.robots.walker(), margins=Margins(held_angle=0.2))
    path, whole = grid_path([(13, 9), (13, 9.5)], 0.1), cylinder()
    assert 0 < len(find_grips(wide, whole, path)) < len(find_grips(wbc.robots.walker(), whole, path))


def test_margins_grow_with_the_reach_and_are_checked() -> None:
    small = Margins.of_reach(0.4318)
    assert small.swing_axis == pytest.approx(0.04)
    assert (small.held_angle, small.hover) == (Margins().held_angle, Margins().hover)
    with pytest.raises(wbc.errors.RangeError, match=r"Margins\.hover"):
        Margins(hover=-1.0)
    with pytest.raises(wbc.errors.RangeError, match="reach"):
        Margins.of_reach(0.0)
    with pytest.raises(wbc.errors.ShapeError, match="expected a body with arms"):
        limb_of(wbc.robots.walker(two_ended=True))
