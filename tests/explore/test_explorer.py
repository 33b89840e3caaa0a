"""What else the robot could have done: solution spaces of ticks, self-motion, and global resolution of paths."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.models import placement
from wbc.errors import InfeasibleError, RangeError, ShapeError, UnknownNameError
from wbc.explore import Explorer
from wbc.explore.pictures import save_pieces
from wbc.resolvers.fsp import Criterion
from wbc.tasks.frames import frame_pose

PANDA = wbc.robots.load("panda", shapes="auto")
Q = np.array([0.3, 0.2, 0.1, -1.8, 0.2, 1.9, 0.4])


def planar(limit: float, joints: int = 3) -> Any:
    rows = [wbc.robots.DHRow(a=1.0, lower=-limit, upper=limit, velocity=1.0) for _ in range(joints)]
    return wbc.robots.from_dh(rows)


def plane_stack(robot: Any) -> Any:
    """The tip's x and y."""
    stack = wbc.Stack(robot, dt=0.01)
    tip = wbc.tasks.Expression(
        lambda kin, p: kin.position("tip")[:2] - p["target"],
        units="m",
        inputs=(wbc.tasks.Input("target", size=2, unit="m", default=np.array([1.5, 0.5])),),
    )
    return stack.add(tip, name="tip")


def far_explorer() -> Explorer:
    """Its target is out of reach."""
    return Explorer(plane_stack(planar(3.0)), [0.3, 0.4, 0.1], values={"tip": {"target": [4.0, 0.0]}})


def pose_stack() -> Any:
    stack = wbc.Stack(PANDA, dt=0.01)
    return stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")


def test_a_tick_has_the_rates_of_the_stack_among_its_choices() -> None:
    stack = pose_stack().add(wbc.tasks.Damping(), name="least", level=1)
    controller = stack.compile(backend="vm")
    controller.reset(Q)
    target = placement(PANDA, "panda_hand_tcp", Q) * pin.SE3(np.eye(3), np.array([0.01, 0.02, -0.01]))
    controller["hand"].target = target
    v = controller.step(Q).v
    found = Explorer(stack, Q, values={"hand": {"target": target}}).tick(Q)
    np.testing.assert_allclose(found.optima["least norm"], v, atol=1e-8)
    assert found.space.coordinates(v)[1] < 1e-8
    assert found.space.span == 2


def test_optima_beat_each_other_by_their_own_criterion() -> None:
    rates = np.array([0.1, 0.0, -0.1, 0.0, 0.2, 0.0])
    found = Explorer(pose_stack(), Q).tick(Q, rates, {"one": Criterion(), "other": Criterion(np.arange(1.0, 8.0))})
    for a, b in (("one", "other"), ("other", "one")):
        assert found.values[a, a] < found.values[a, b]
    # Ranges: every choice within the limits of speed lies in them, and their ends are reached by one
    space, most = found.space, PANDA.limits.velocity
    z = np.linspace(-5, 5, 20001)
    v = space.vectors[0] + z[:, None] * space.directions[0]
    kept = v[(np.abs(v) <= most).all(axis=1)]
    assert (kept >= found.lower - 1e-9).all()
    assert (kept <= found.upper + 1e-9).all()
    np.testing.assert_allclose(kept.min(axis=0), found.lower, atol=1e-3)
    np.testing.assert_allclose(kept.max(axis=0), found.upper, atol=1e-3)


def test_rates_beyond_all_limits_leave_no_range() -> None:
    found = Explorer(pose_stack(), Q).tick(Q, np.array([50.0, 0, 0, 0, 0, 0]))
    assert np.isnan(found.lower).all()


def test_self_motion_ends_at_limits_or_closes() -> None:
    explorer = Explorer(pose_stack(), Q)
    curve, whole = explorer.trace(Q), explorer.trace(Q, through=True)
    assert not curve.closed
    assert all("panda_joint" in end for end in curve.ends)
    assert not any(curve.broken)
    assert whole.closed
    assert any(whole.broken)
    for piece in (curve, whole):
        assert max(np.abs(explorer.rows.errors(q)[0]).max() for q in piece.q) < 1e-9
        assert np.linalg.norm(np.diff(piece.q, axis=0), axis=1).max() < 0.1
        assert piece.free == 1
    # At its ends the joint that stops it is at its limit
    joint, side = curve.ends[1].split()
    limit = getattr(PANDA.limits, f"position_{side}")[PANDA.dof_names.index(joint)]
    assert curve.q[-1][PANDA.dof_names.index(joint)] == pytest.approx(limit, abs=1e-6)


def test_pieces_of_a_planar_arm_are_those_of_theory() -> None:
    """Three links of 1 m, tip at 2.5 m: the self-motion is one closed curve; at 0.5 m it is two."""
    robot = planar(np.pi)
    for reach, count in ((2.5, 1), (0.5, 2)):
        stack = plane_stack(robot)
        explorer = Explorer(stack, np.array([0.3, 0.4, 0.5]), values={"tip": {"target": [reach, 0.0]}})
        found = explorer.pieces(np.array([0.3, 0.4, 0.5]), through=True, step=0.05, seeds=30)
        assert (len(found), all(piece.closed for piece in found)) == (count, True)


def test_the_best_configuration_is_on_the_curve_and_keeps_what_must_hold() -> None:
    stack = pose_stack()
    stack.add(
        wbc.tasks.Obstacle(wbc.shapes.Sphere(0.1), pose=pin.SE3(np.eye(3), np.array([0.3, 0.5, 0.5]))), name="ball"
    )
    explorer = Explorer(stack, Q)
    pieces = explorer.pieces(Q, seeds=3, through=True)
    best, room = explorer.best(pieces)
    assert explorer.rows.broken(best) == ""
    assert room == max(explorer.rows.room(q) for p in pieces for q, b in zip(p.q, p.broken, strict=True) if not b)
    assert any("ball" in text for piece in pieces for text in piece.broken)
    lowest, value = explorer.best(pieces, lambda q: -float(q[3]))
    assert value == -lowest[3]


def path_near_limits(seed: int) -> tuple[Any, list[np.ndarray], np.ndarray]:
    """A straight line of the tip, from a configuration of an arm with narrow limits to another one's place."""
    rng = np.random.default_rng(seed)
    robot = planar(1.9)
    first, last = rng.uniform(-1.9, 1.9, (2, 3))

    def tip(q: np.ndarray) -> np.ndarray:
        turned = np.cumsum(q)
        return np.array([np.cos(turned).sum(), np.sin(turned).sum()])

    return robot, [tip(first) + k * (tip(last) - tip(first)) for k in np.linspace(0, 1, 15)], first


def meets(explorer: Explorer, found: Any, targets: list[np.ndarray], step: float) -> None:
    """Every configuration meets its target within the limits, and no step is too long but where the branch changes."""
    number = np.rint(found.s * (len(targets) - 1)).astype(int)
    assert set(number) == set(range(len(targets)))
    assert (np.flatnonzero(np.diff(number) == 0) + 1).tolist() == list(found.changes)
    for q, k in zip(found.q, number, strict=True):
        explorer.rows.aim("tip", targets[k])
        assert np.abs(explorer.rows.errors(q)[0]).max() < 1e-9
        assert explorer.rows.broken(q) == ""
    steps = np.abs(np.diff(found.q, axis=0)).max(axis=1)
    assert (np.delete(steps, np.array(found.changes, dtype=int) - 1) <= step).all()


def test_a_whole_path_is_resolved_where_single_steps_end_at_a_limit() -> None:
    """More freedom, more paths: single steps, the same branch, any start, changes of branch on the way."""
    done = {"steps": 0, "whole": 0, "anywhere": 0, "changes": 0}
    ways: dict[str, Any] = {"whole": {}, "anywhere": {"anywhere": True}, "changes": {"anywhere": True, "change": 1.0}}
    changed = 0
    for seed in (0, 3, 4, 5, 9):
        robot, targets, first = path_near_limits(seed)
        targets = targets[::2]
        explorer = Explorer(plane_stack(robot), first, values={"tip": {"target": targets[0]}})
        done["steps"] += not explorer.step_by_step({"tip": targets}, first, step=0.7)[1]
        for name, way in ways.items():
            try:
                found = explorer.along({"tip": targets}, first, step=0.7, nodes=20, **way)
            except InfeasibleError:
                continue
            done[name] += 1
            changed += len(found.changes)
            meets(explorer, found, targets, 0.7)
    assert done["steps"] < done["whole"] < done["anywhere"] < done["changes"] == 5
    assert changed > 0


def test_a_resolution_becomes_a_law_of_motion() -> None:
    """At rest where the branch changes, and straight in the joints there."""
    robot, targets, first = path_near_limits(5)
    targets = targets[::2]
    explorer = Explorer(plane_stack(robot), first, values={"tip": {"target": targets[0]}})
    found = explorer.along({"tip": targets}, first, step=0.7, nodes=20, change=1.0)
    law = found.law(1.0, 5.0)
    assert law.certificate
    states = law.at(np.linspace(0.0, law.duration, 4000))
    assert len(found.changes) > 0
    for k in found.changes:
        here, there = (np.abs(states.position - found.q[j]).max(axis=1) for j in (k - 1, k))
        between = states.position[here.argmin() : there.argmin() + 1]
        assert np.abs(states.velocity[[here.argmin(), there.argmin()]]).max() < 0.01
        way = found.q[k] - found.q[k - 1]
        across = (between - found.q[k - 1]) - np.outer((between - found.q[k - 1]) @ way / (way @ way), way)
        assert np.abs(across).max() < 1e-3


def box_arm() -> Any:
    """Three links as boxes, whose distances from another box no expression states."""
    turned = pin.SE3(np.eye(3), np.array([-0.5, 0.0, 0.0]))
    shape = wbc.shapes.Box((0.9, 0.1, 0.1))
    return planar(2.0).with_shapes({f"link{k}": [wbc.shapes.PlacedShape(shape, turned)] for k in (1, 2, 3)})


def box_gap(robot: Any, q: np.ndarray, place: pin.SE3, size: tuple[float, float, float]) -> float:
    """Least distance of the links from a box, by Coal."""
    gaps = []
    for k in (1, 2, 3):
        link = frame_pose(robot, f"link{k}", q) * pin.SE3(np.eye(3), np.array([-0.5, 0.0, 0.0]))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        boxes = coal.Box(0.9, 0.1, 0.1), coal.Box(*size)
        placed = [coal.Transform3s(p.rotation, p.translation) for p in (link, place)]
        gaps.append(coal.distance(boxes[0], placed[0], boxes[1], placed[1], request, result))
    return min(gaps)


def test_measured_distances_are_margins_too() -> None:
    robot = box_arm()
    place = pin.SE3(np.eye(3), np.array([1.2, 1.2, 0.0]))
    wall = wbc.shapes.Box((0.2, 0.2, 0.2))
    stack = plane_stack(robot).add(wbc.tasks.Obstacle(wall, margin=0.05, pose=place), name="wall")
    explorer = Explorer(stack, [0.3, 0.4, 0.1], values={"tip": {"target": [1.5, 0.5]}})
    pieces = explorer.pieces([0.3, 0.4, 0.1], seeds=6, through=True, step=0.1)
    assert any("wall/closest" in what for piece in pieces for _, _, what in piece.windows)
    for q, broken in [(q, b) for p in pieces for q, b in zip(p.q, p.broken, strict=True)][::7]:
        gap = box_gap(robot, q, place, (0.2, 0.2, 0.2))
        if not broken:
            assert gap > 0.05 - 1e-6
        elif "wall" in broken:
            assert gap < 0.05 + 1e-6


def test_held_frames_are_goals() -> None:
    """The second link held in its place by a Hold: what the tip may still do is what it may with a goal there."""
    robot, q = planar(3.0, 5), np.array([0.3, 0.4, -0.5, 0.6, 0.2])
    held = Explorer(plane_stack(robot).add(wbc.tasks.Hold("link2", kind="position"), name="grip"), q)
    other = plane_stack(robot).add(wbc.tasks.EndEffector("link2", kind="position"), name="grip")
    named = Explorer(other, q)
    one, two = (e.tick(q, rates) for e, rates in ((held, [0.1, 0.2]), (named, [0.1, 0.2, 0, 0, 0])))
    np.testing.assert_allclose(one.optima["least norm"], two.optima["least norm"], atol=1e-12)
    far = q + 0.1
    np.testing.assert_allclose(held.rows.errors(far)[0], named.rows.errors(far)[0], atol=1e-12)
    curve = held.trace(q, through=True)
    tip = [frame_pose(robot, "link2", x).translation for x in curve.q]
    np.testing.assert_allclose(tip, np.tile(frame_pose(robot, "link2", q).translation, (len(tip), 1)), atol=1e-9)


def test_what_the_mechanism_holds_stays() -> None:
    """A base that cannot go sideways, and a joint that is fixed."""
    robot = wbc.robots.load("tiago", base="differential", shapes="none")
    stack = wbc.Stack(robot, dt=0.01).add(wbc.tasks.EndEffector(robot.frames["tip"], kind="position"), name="hand")
    stack.add(wbc.tasks.Fixed(("torso_lift_joint",)))
    still = [robot.locked_dofs[0], robot.dof_names.index("torso_lift_joint")]
    explorer = Explorer(stack, robot.neutral)
    found = explorer.tick(robot.neutral, [0.05, 0.02, -0.03])
    np.testing.assert_allclose(found.space.vectors[:, still], 0.0, atol=1e-12)
    np.testing.assert_allclose(explorer.rows.self_motions(robot.neutral)[:, still], 0.0, atol=1e-12)
    curve = explorer.trace(robot.neutral)
    assert len(curve.q) > 3
    assert np.ptp(curve.q[:, robot.model.joints[robot.model.getJointId("torso_lift_joint")].idx_q]) < 1e-9


def test_no_chain_names_the_target() -> None:
    robot, targets, first = path_near_limits(0)
    explorer = Explorer(plane_stack(robot), first, values={"tip": {"target": targets[0]}})
    with pytest.raises(InfeasibleError, match="no configuration meets") as caught:
        explorer.along({"tip": [*targets[:4], np.array([5.0, 0.0])]}, first, step=0.8)
    assert caught.value.value == 4


def test_the_picture_is_drawn(tmp_path: Any) -> None:
    explorer = Explorer(pose_stack(), Q)
    pieces = explorer.pieces(Q, seeds=0)
    save_pieces(PANDA, pieces, tmp_path / "a.png", explorer.best(pieces)[0])
    assert (tmp_path / "a.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: Explorer(PANDA, Q), ShapeError),
        (lambda: Explorer(wbc.Stack(PANDA, dt=0.01), Q), RangeError),
        (lambda: Explorer(pose_stack(), Q[:3]), ShapeError),
        (lambda: Explorer(pose_stack(), Q).along({"hand": [np.zeros(3)]}, Q, change=-1.0), RangeError),
        (lambda: Explorer(pose_stack(), Q).along({"arm": [np.zeros(3)]}, Q), UnknownNameError),
        (lambda: Explorer(pose_stack(), Q, goals=("hnd",)), UnknownNameError),
        (lambda: Explorer(pose_stack(), Q, values={"hnd": {}}), UnknownNameError),
        (lambda: Explorer(pose_stack(), Q, values={"hand": {"targt": 1}}), UnknownNameError),
        (lambda: Explorer(pose_stack(), Q).tick(Q, [1.0]), ShapeError),
        (lambda: Explorer(plane_stack(planar(3.0, 2)), [0.3, 0.4]).trace([0.3, 0.4]), RangeError),
        (lambda: far_explorer().trace([0.3, 0.4, 0.1]), InfeasibleError),
        (lambda: Explorer(pose_stack(), Q).along({"hand": []}, Q), ShapeError),
        (lambda: Explorer(pose_stack(), Q).best([]), InfeasibleError),
    ],
)  # fmt: skip
def test_bad_input(call: Any, error: type[Exception]) -> None:
    with pytest.raises(error):
        call()
