"""The reference search: its ways are real, its refusals consistent."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import pinocchio as pin
import pytest

from bench.walk.reference import STRICT, GridPose, Reference, Rules, Step, fewest_along
from bench.walk.reference.arm_table import arm_table
from bench.walk.reference.lattice import FAR
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.walking import ArmKinematics, Structure, cylinder, plane, remove_rows
from wbc.walking.holds.built_in import INCH, grid_pose

HEIGHT = 52 * INCH
SOUTH, NORTH = GridPose(13, 7, None), GridPose(13, 18, None)


@pytest.fixture(scope="module")
def reference() -> Reference:
    return Reference(heights=(HEIGHT,))


@pytest.fixture(scope="module")
def whole() -> Structure:
    return cylinder()


def patch(whole: Structure, t: int = 9, a: int = 8, side: int = 8) -> Structure:
    """A square of holds."""
    return part(whole, lambda x, y: t <= x < t + side and a <= y < a + side)


def part(whole: Structure, wanted: Callable[[int, int], bool]) -> Structure:
    kept = {f"{t},{a}" for t in range(1, 26) for a in range(1, 25) if wanted(t, a)}
    return whole.without([hold for hold in whole.ids if hold not in kept])


def frame(pose: GridPose) -> np.ndarray:
    assert pose.heading is not None
    assert pose.height is not None
    return grid_pose(pose.t, pose.a, 100 * INCH + pose.height, pose.heading).homogeneous


def check(reference: Reference, structure: Structure, path: tuple[Step, ...]) -> None:
    """Every stance and every pose between: inverse kinematics within the limits, Pinocchio at the holds, clearances."""
    machine = reference.machine
    kinematics, model = ArmKinematics(machine.arm_data), machine.robot.model
    data = model.createData()
    for k, step in enumerate(path):
        assert len(set(step.holds)) == 3
        assert set(step.holds) <= set(structure.ids)
        if k + 1 < len(path):
            after = path[k + 1]
            assert step.route[-1] == after.pose
            assert step.route[0] == step.pose
            assert all(step.holds[arm] == after.holds[arm] for arm in range(3) if arm != step.moves)
            assert all(step.branches[arm] == after.branches[arm] for arm in range(3) if arm != step.moves)
        for pose in step.route:
            q = np.array(pin.neutral(model))
            body = pin.SE3(frame(pose))
            q[:7] = pin.SE3ToXYZQUAT(body)
            arms = range(3) if pose == step.pose else [arm for arm in range(3) if arm != step.moves]
            for arm in arms:
                hold = structure[step.holds[arm]].pose
                local = (body * machine.arms[arm].base).actInv(hold)
                postures, solved = kinematics.inverse_axis(local.translation[None], local.rotation[:, 2][None])
                posture = postures[0, step.branches[arm]]
                assert solved[0, step.branches[arm]]
                assert (np.abs(posture[:5]) <= 0.95 * np.array(kinematics.data.position_limits[:5]) + 1e-9).all()
                assert kinematics.wrist_reach(kinematics.wrist(posture)) >= 0.25 * INCH - 1e-9
                q[machine.arms[arm].q] = posture
            pin.framesForwardKinematics(model, data, q)
            points = {}
            for arm in arms:
                hand, hold = data.oMf[model.getFrameId(machine.arms[arm].hand)], structure[step.holds[arm]].pose
                assert np.abs(hand.translation - hold.translation).max() < 1e-9
                assert np.abs(hand.rotation[:, 2] - hold.rotation[:, 2]).max() < 1e-9
                points[arm] = core(machine, data, arm)
            apart(points, kinematics.data.clearance)


def core(machine, data, arm: int) -> list[tuple[np.ndarray, float]]:
    """Points on the cores of upper arm, forearm and hand, and the radius, from the robot's own shapes."""
    out = []
    for link in machine.arms[arm].links[1:]:
        (shape,) = machine.robot.shapes[link]
        a, b = shape.ends()
        place = data.oMf[machine.robot.model.getFrameId(link)]
        along = np.linspace(0.0, 1.0, 15)[:, None]
        out.append(((a + along * (b - a)) @ place.rotation.T + place.translation, shape.shape.radius))
    return out


def apart(points, clearance: float) -> None:
    for one in points:
        for points_one, radius in points[one][:2]:
            height = np.linalg.norm(points_one[:, :2], axis=1) - 100 * INCH
            assert height.min() >= radius + clearance - 1e-9
        for other in points:
            for points_one, radius_one in points[one] if one < other else ():
                for points_other, radius_other in points[other]:
                    gap = np.linalg.norm(points_one[:, None] - points_other, axis=-1).min()
                    assert gap >= radius_one + radius_other + clearance - 1e-9


def test_a_trench_of_four_rows_is_possible(reference: Reference, whole: Structure) -> None:
    structure = remove_rows(whole, "11-14")
    verdict = reference.judge(structure, SOUTH, NORTH)
    assert verdict.kind == "possible"
    assert verdict.separating == ()
    assert (verdict.path[0].pose.t, verdict.path[0].pose.a) == (13, 7)
    assert (verdict.path[-1].pose.t, verdict.path[-1].pose.a) == (13, 18)
    check(reference, structure, verdict.path)


def test_wider_trenches_never_become_possible_again(reference: Reference, whole: Structure) -> None:
    rows = ["11-14", "10-15", "9-16", "8-17"]
    verdicts = [reference.judge(remove_rows(whole, r), GridPose(13, 5, None), GridPose(13, 20, None)) for r in rows]
    kinds = [verdict.kind for verdict in verdicts]
    assert kinds[:1] == ["possible"]
    assert kinds[-2:] == ["impossible", "impossible"]
    order = [("possible", "undecided", "impossible").index(kind) for kind in kinds]
    assert order == sorted(order)
    # The way ends at the last row before the trench
    assert {hold.split(",")[1] for hold in verdicts[2].separating} == {"8"}
    assert "1,8" in verdicts[2].reason


@pytest.mark.parametrize("seed", [1, 2])
def test_turned_moved_and_shifted_scenes_are_judged_alike(reference: Reference, whole: Structure, seed: int) -> None:
    rng = np.random.default_rng(seed)
    kept = {(int(t), int(a)) for t, a in rng.integers(5, 16, size=(60, 2))}
    first = part(whole, lambda t, a: (t, a) in kept)
    turned = part(whole, lambda t, a: (20 - t, 20 - a) in kept)
    shifted = part(whole, lambda t, a: (t - 4, a - 3) in kept)
    moved = first.moved(pin.SE3(pin.utils.rotate("x", 1.0), np.array([1.0, 2.0, 3.0])))
    cases = [
        (first, GridPose(8, 9, 0.0), GridPose(12, 12, 0.0)),
        (turned, GridPose(12, 11, pi), GridPose(8, 8, pi)),
        (shifted, GridPose(12, 12, 0.0), GridPose(16, 15, 0.0)),
        (moved, GridPose(8, 9, 0.0), GridPose(12, 12, 0.0)),
    ]
    verdicts = [reference.judge(*case) for case in cases]
    assert len({verdict.kind for verdict in verdicts}) == 1
    if verdicts[0].kind == "possible":
        fewest = [reference.fewest_regrasps(*case) for case in cases]
        assert len({verdict.regrasps for verdict in fewest}) == 1
        assert fewest[0].regrasps <= verdicts[0].regrasps
        check(reference, first, fewest[0].path)


def test_a_hold_more_never_raises_the_fewest_regrasps(reference: Reference, whole: Structure) -> None:
    square = patch(whole)
    order = np.random.default_rng(3).permutation(len(square))
    start, goal = GridPose(12, 11, 0.0), GridPose(13, 14.5, 0.0)
    counts, kinds = [], []
    for gone in (44, 36, 24, 12, 0):
        structure = square.without([square.ids[k] for k in order[:gone].tolist()])
        verdict = reference.fewest_regrasps(structure, start, goal)
        counts.append(verdict.regrasps if verdict.path else 99)
        kinds.append(reference.judge(structure, start, goal).kind)
        assert (verdict.kind == "possible") <= (kinds[-1] == "possible")
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < 99
    order = [("impossible", "undecided", "possible").index(kind) for kind in kinds]
    assert order == sorted(order)


def test_fewest_along_agrees_with_a_plain_search(reference: Reference, whole: Structure) -> None:
    rules = Rules(collisions=False)
    structure = part(whole, lambda t, a: 11 <= t <= 15 and 8 <= a <= 17 and (t + a) % 3 != 0)
    cells = np.array([(0, 0, 52, y) for y in range(40, 57)])
    poses = reference.lattice.frames(cells)
    count = fewest_along(reference.machine, structure, poses, rules)
    assert count == plain(reference, structure, poses)
    assert count is not None
    assert count > 0
    # The whole lattice can only do better, collisions only worse
    strict = fewest_along(reference.machine, structure, poses, STRICT)
    verdict = reference.fewest_regrasps(structure, GridPose(13, 10), GridPose(13, 14))
    assert verdict.kind == "possible"
    assert strict is None or verdict.regrasps <= strict
    assert strict is None or strict >= count


def plain(reference: Reference, structure: Structure, poses: np.ndarray) -> int | None:
    """Breadth first over sets of (two grips, pose), with single inverse kinematics."""
    machine = reference.machine
    kinematics = ArmKinematics(machine.arm_data)
    grips: list[dict[tuple[int, int, int], np.ndarray]] = []  # of each arm: (hold, branch, pose) -> posture
    for arm in machine.arms:
        mine = {}
        for p, pose in enumerate(poses):
            inverse = np.linalg.inv(pose @ arm.base.homogeneous)
            local = structure.positions @ inverse[:3, :3].T + inverse[:3, 3]
            q, solved = kinematics.inverse_axis(local, structure.axes @ inverse[:3, :3].T)
            mine.update({(int(h), int(b), p): q[h, b] for h, b in np.argwhere(solved)})
        grips.append(mine)

    def carried(two: set[tuple]) -> set[tuple]:
        """(arm, grip, arm, grip, pose) and what they become as the body goes on."""
        out, todo = set(two), list(two)
        while todo:
            i, g, j, h, p = todo.pop()
            before, after = (
                (grips[i][(*g, p)], grips[j][(*h, p)]),
                (grips[i].get((*g, p + 1)), grips[j].get((*h, p + 1))),
            )
            if all(x is not None and np.abs(x - y)[:5].max() <= pi / 3 for x, y in zip(after, before, strict=True)):
                there = (i, g, j, h, p + 1)
                if there not in out:
                    out.add(there)
                    todo.append(there)
        return out

    by_pose = [[[g[:2] for g in mine if g[2] == p] for mine in grips] for p in range(len(poses))]
    level = set()
    for g in by_pose[0][0]:
        for h in by_pose[0][1]:
            for x in by_pose[0][2]:
                if len({g[0], h[0], x[0]}) == 3:
                    level |= {(0, g, 1, h, 0), (1, h, 2, x, 0), (0, g, 2, x, 0)}
    known: set[tuple] = set()
    for count in range(1, 20):
        known |= carried(level - known)
        level = set()
        for i, g, j, h, p in known:
            k = 3 - i - j
            for x in by_pose[p][k]:
                if x[0] not in (g[0], h[0]):
                    if p == len(poses) - 1:
                        return count
                    level |= {(*sorted_pair(i, g, k, x), p), (*sorted_pair(j, h, k, x), p)}
    return None


def sorted_pair(i, g, k, x) -> tuple:
    return (i, g, k, x) if i < k else (k, x, i, g)


def test_what_an_arm_can_do_between_poses_is_in_the_relaxed_table(reference: Reference) -> None:
    """Random poses and hands tilted by up to 0.05 rad: no hold that an arm has is missing at the nearest pose."""
    table = arm_table(reference.machine, reference.lattice, reference.relaxed).fits[0]
    kinematics = ArmKinematics(reference.machine.arm_data)
    rng = np.random.default_rng(0)
    cells = rng.uniform([0, 0, -18, -18], [0, 24, 18, 18], size=(20_000, 4))
    bases = reference.lattice.frames(cells) @ reference.machine.arms[0].base.homogeneous
    hold = grid_pose(0, 0)
    inverse = np.swapaxes(bases[:, :3, :3], 1, 2)
    points = np.einsum("nij,nj->ni", inverse, hold.translation - bases[:, :3, 3])
    tilt = rng.uniform(-1.0, 1.0, size=(len(cells), 3))
    tilt *= (0.05 * rng.uniform(size=len(cells)) / np.linalg.norm(tilt, axis=1))[:, None]
    axes = hold.rotation[:, 2] + np.cross(tilt, hold.rotation[:, 2])
    axes = np.einsum("nij,nj->ni", inverse, axes / np.linalg.norm(axes, axis=1)[:, None])
    held = kinematics.inverse_axis(points, axes)[1].any(axis=1)
    near = np.rint(cells).astype(int)
    found = table[0, near[:, 1] % 24, near[:, 2] + FAR, near[:, 3] + FAR]
    assert held.sum() > 2000
    assert not (held & ~found).any()


def test_bad_input_is_named(reference: Reference, whole: Structure) -> None:
    with pytest.raises(RangeError, match=r"start\.t"):
        reference.judge(whole, GridPose(13.1, 7), NORTH)
    with pytest.raises(RangeError, match=r"goal\.heading"):
        reference.judge(whole, SOUTH, GridPose(13, 7, 0.1))
    with pytest.raises(RangeError, match=r"goal\.height"):
        reference.judge(whole, SOUTH, GridPose(13, 7, 0.0, 1.0))
    with pytest.raises(ShapeError, match="cylinder"):
        reference.judge(plane(), SOUTH, NORTH)
    with pytest.raises(UnknownNameError, match="arm9"):
        reference.judge(whole, SOUTH, NORTH, stance={"arm9": "1,1"})
    with pytest.raises(RangeError, match=r"Rules\.dilated"):
        Rules(dilated=0.3)
    with pytest.raises(ShapeError, match="poses"):
        fewest_along(reference.machine, whole, np.eye(4), STRICT)
    verdict = reference.judge(patch(whole), GridPose(12, 11), GridPose(20, 20))
    assert verdict.kind == "impossible"
    assert "goal" in verdict.reason
    assert verdict.path == ()
