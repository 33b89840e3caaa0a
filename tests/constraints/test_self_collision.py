"""SelfCollision and sensed rows: margins against Coal, rows in the stack, overlaps at the start, bad declarations."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.closed_loop.collisions import ROCK
from tests.closed_loop.eyes import Gaps
from tests.constraints.robots import NAMES, robot
from tests.evaluation import probe, random_configuration
from tests.models import placement
from tests.refusals import assert_refused
from wbc.api import Controller, Stack
from wbc.controller import Status, core_of
from wbc.errors import (
    MissingShapeError,
    RangeError,
    ShapeError,
)
from wbc.proximity import MAX_PAIRS, Body, distances
from wbc.robot import Robot
from wbc.robot.pairs.link_pairs import link_pairs, neighbours
from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape, Sphere
from wbc.tasks import JointLimits, Obstacle, Posture, self_collision as module
from wbc.tasks.self_collision import SelfCollision

#: A link of the Panda without shapes
BARE = "panda_link7"

BALL = PlacedShape(Sphere(0.06), pin.SE3.Identity())


def split(label: str) -> tuple[str, int]:
    link, number = label.rstrip("]").split("[")
    return link, int(number)


@pytest.mark.parametrize("name", NAMES)
def test_margins_are_those_of_coal(name: str) -> None:
    bot, rng = robot(name), np.random.default_rng(41)
    item = SelfCollision(method="symbolic")
    clear = probe(item, bot)
    labels = [row.label for row in item.rows(bot)]
    ends = [label.split(" ") for label in labels if label.count("]") == 2 and label.endswith("]")]
    pairs = [tuple((link, bot.shapes[link][k]) for link, k in map(split, pair)) for pair in ends]
    assert {(a, b) for (a, _), (b, _) in pairs} == set(link_pairs(bot)) - set(neighbours(bot))
    truth, inside = Gaps(bot, pairs), 0
    for _ in range(30):
        q, margin = random_configuration(bot, rng), rng.uniform(0.0, 0.05)
        h = dict(zip(labels, clear(q, margin=margin)[0], strict=True))
        for (a, b), gap in zip(ends, truth(q) - margin, strict=True):
            whole = [value for label, value in h.items() if label.startswith(f"{a} {b}")]
            assert h[f"{a} {b}"] == pytest.approx(gap, abs=1e-9)
            assert min(whole) > gap - 1e-9, "no row asks for more than the distance of the shapes"
            inside += gap < 0
    assert inside > 5


def test_a_row_moves_only_the_joints_between_its_links() -> None:
    bot = robot("talos")
    clear = probe(SelfCollision(method="symbolic"), bot)
    q = random_configuration(bot, np.random.default_rng(3))
    labels = [row.label for row in SelfCollision(method="symbolic").rows(bot)]
    for label, row in zip(labels, clear(q)[1], strict=True):
        (a, _), (b, _) = (split(part.split("]")[0] + "]") for part in label.split(" "))
        joints = [set(bot.model.supports[bot.model.frames[bot.model.getFrameId(link)].parentJoint]) for link in (a, b)]
        moved = [int(bot.model.idx_vs[j]) + k for j in joints[0] ^ joints[1] for k in range(int(bot.model.nvs[j]))]
        assert set(np.flatnonzero(row)) <= set(moved)
        assert row[:6] == pytest.approx(0.0, abs=0.0), "the base moves both"


def boxed() -> Robot:
    """A Panda with a box, a cylinder, a hull, a sphere and a capsule."""
    hull = Convex(0.07 * np.random.default_rng(2).normal(size=(20, 3)))
    shapes = (Box((0.1, 0.2, 0.15)), Cylinder(0.06, 0.2), hull, Sphere(0.05), Capsule(0.04, 0.2))
    links = ("panda_link0", "panda_link2", "panda_link4", "panda_link6", "panda_hand")
    turn = pin.SE3(pin.exp3(np.array([0.3, -0.7, 0.5])), np.array([0.01, 0.02, 0.03]))
    return robot("panda").with_shapes({k: (PlacedShape(s, turn),) for k, s in zip(links, shapes, strict=True)})


ITEMS: dict[str, Any] = {
    "self": lambda: SelfCollision([("panda_link0", "panda_link4"), ("panda_link0", "panda_hand")], closest=9),
    "self, all": lambda: SelfCollision(list(itertools.combinations(boxed().shapes, 2)), method="sensed", closest=4),
    "rock": lambda: Obstacle(ROCK, closest=5),
    "crate": lambda: Obstacle(Box((0.3, 0.2, 0.1)), closest=3),
}


@pytest.mark.parametrize("name", ITEMS)
def test_sensed_rows_in_the_stack(name: str) -> None:
    """(A v, lower) of the QP against differences of the distances that Coal measures."""
    bot, item, rng = boxed(), ITEMS[name](), np.random.default_rng(42)
    control = Stack(bot, 0.01).add(item, name="item").compile(backend="vm")
    known = {(a.name, b.name): (a, b) for a, b in item.sensed_pairs(bot)}
    sensed, rows, checked = item.sensed_rows(bot), len(item.rows(bot)), 0
    count = min(item.closest, len(known))
    assert 0 < count * (1 + item.corners) == sensed
    for _ in range(12):
        q, v = random_configuration(bot, rng), rng.uniform(-1, 1, bot.nv)
        pose, twist = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.5, 0.5, 3)), rng.uniform(-1, 1, 6)
        if isinstance(item, Obstacle):
            control["item"].pose, control["item"].velocity = pose, twist
        control["item"].margin = 0.015
        control.reset(q)
        found_again = core_of(control).resets
        control.step(q)
        qp = control.qp()
        pairs = control.pairs("item")
        every = dict(zip(known, distances(bot, list(known.values()), q, pose), strict=True))
        assert len(pairs) == count
        # After a reset no pair has a row to keep: the nearest have them, but where the command made others urgent
        if core_of(control).resets == found_again:
            assert sorted(d for _, _, d in pairs) == pytest.approx(sorted(every.values())[:count], abs=2e-6)
        assert [d for _, _, d in pairs] == pytest.approx([every[a, b] for a, b, _ in pairs], abs=1e-6)
        for k, (a, b, distance) in enumerate(pairs):
            row, low = qp.A[rows - sensed + k], qp.lower[bot.nv + rows - sensed + k]
            rate, bend = slope(bot, known[a, b], q, v, pose, twist * isinstance(item, Obstacle))
            if bend < 1e-3 and distance > 0:
                drift = -low - control["item"].rate * (distance - 0.015)
                assert row @ v + drift == pytest.approx(rate, abs=2e-3)
                checked += 1
    assert checked > 10


def slope(
    bot: Robot, pair: tuple[Body, Body], q: np.ndarray, v: np.ndarray, pose: pin.SE3, twist: np.ndarray
) -> tuple[float, float]:
    """Rate of a distance as robot and obstacle move, and how far both one-sided differences are apart."""

    def after(t: float) -> float:
        moved = pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
        return float(distances(bot, [pair], pin.integrate(bot.model, q, t * v), moved)[0])

    step = 1e-4
    ahead, here, behind = after(step), after(0.0), after(-step)
    return (ahead - behind) / (2 * step), abs(ahead - 2 * here + behind) / step


def recovery(
    control: Controller, bot: Robot, q: np.ndarray, name: str, ticks: int = 60
) -> tuple[list[float], list[Status]]:
    """The least margin and the status tick by tick."""
    least, status = [], []
    for _ in range(ticks):
        step = control.step(q)
        least.append(float(step.margins[name].min()))
        status.append(step.status)
        q = pin.integrate(bot.model, q, 0.01 * step.v)
    return least, status


@pytest.mark.parametrize("method", ["symbolic", "sensed"])
def test_an_overlap_at_the_start_is_left_at_the_rate(method: str) -> None:
    """Two links overlap by 3 cm; h grows as exp(-rate t) says while the joints can, without a contradiction."""
    bot, q = overlapping()
    stack = Stack(bot, 0.01).add(Posture(), name="rest").add(JointLimits(acceleration=False), name="limits")
    stack.add(SelfCollision([("panda_link0", "panda_hand")], margin=0.01, method=method), name="self")
    control = stack.compile(backend="vm")
    control["self"].rate = 2.0
    least, status = recovery(control, bot, q, "self")
    assert least[0] == pytest.approx(-0.04, abs=1e-3)
    assert set(status) == {Status.SOLVED}
    for before, now in itertools.pairwise(least):
        assert now > (1 - 2.0 * 0.01) * before - 1e-4
    assert least[-1] > -0.04 * np.exp(-1.1)


def overlapping() -> tuple[Robot, np.ndarray]:
    """A ball of the hand 3 cm into one of the base."""
    bot = robot("panda")
    q = bot.neutral
    base, hand = (placement(bot, link, q) for link in ("panda_link0", "panda_hand"))
    towards = base.actInv(hand.translation) + np.array([0.06, 0.0, -0.0671])
    place = pin.SE3(np.eye(3), towards)
    assert np.linalg.norm(towards - base.actInv(hand.translation)) == pytest.approx(0.09, abs=1e-3)
    shapes = {"panda_link0": (PlacedShape(Sphere(0.06), place),), "panda_hand": (BALL,)}
    return bot.with_shapes(shapes), q


def test_an_overlap_that_limits_do_not_let_go_is_said() -> None:
    """At a hundredth of the joints' speeds the wanted rate cannot be had: the row gives way, by name; h still grows."""
    bot, q = overlapping()
    stack = Stack(bot, 0.01).add(Posture(), name="rest").add(JointLimits(acceleration=False), name="limits")
    stack.add(SelfCollision([("panda_link0", "panda_hand")]), name="self")
    control = stack.compile(backend="vm")
    control["limits"].velocity_scale = 0.01
    step = control.step(q)
    assert step.status is Status.RELAXED
    assert [(slack.item, slack.row) for slack in step.relaxed] == [("self", "panda_link0[0] panda_hand[0]")]
    least, _ = recovery(control, bot, q, "self", 10)
    assert (np.diff(least) > 0).all()


@pytest.mark.parametrize("shape", [Sphere(0.1), Capsule(0.1, 0.2), Box((0.2, 0.2, 0.2)), Cylinder(0.1, 0.2), ROCK[:1]])
@pytest.mark.parametrize(
    "solid", [Sphere(0.05), Capsule(0.05, 0.1), Box((0.1, 0.1, 0.1))], ids=lambda s: type(s).__name__
)
def test_a_shape_in_the_middle_of_another_finds_a_way_out(solid: Any, shape: Any) -> None:
    bot = robot("panda").with_shapes({"panda_hand": (PlacedShape(solid, pin.SE3.Identity()),)})
    stack = Stack(bot, 0.01).add(JointLimits(acceleration=False), name="limits").add(Obstacle(shape), name="thing")
    control, q = stack.compile(backend="vm"), bot.neutral
    control["thing"].pose = placement(bot, "panda_hand", q)
    least, status = recovery(control, bot, q, "thing", 80)
    assert np.isfinite(least).all()
    assert Status.BRAKED not in status
    assert least[0] < -0.04
    assert least[-1] > -5e-3


def test_which_pairs_and_which_method() -> None:
    bot = robot("panda")
    links = list(bot.shapes)
    assert SelfCollision().link_pairs(bot.with_self_pairs([(links[0], links[2])])) == ((links[0], links[2]),)
    gone = bot.with_self_pairs([(links[0], links[2]), (links[0], BARE)])
    assert SelfCollision().link_pairs(gone) == ((links[0], links[2]),), "a link without shapes"
    mixed = boxed()
    auto = [row.label for row in SelfCollision([("panda_link0", "panda_link6")]).rows(mixed)]
    assert auto == ["panda_link0[0] panda_link6[0]"]
    both = [row.label for row in SelfCollision([("panda_link0", "panda_hand")]).rows(mixed)]
    assert both[:3] == ["panda_link0[0] panda_hand[0].start", "panda_link0[0] panda_hand[0].end", "closest[0]"]
    assert both[3:] == [f"closest[0].corner[{k}]" for k in range(4)]
    assert SelfCollision([("panda_link0", "panda_hand")], method="sensed", corners=0).sensed_rows(mixed) == 1


def test_many_pairs_are_sensed_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    bot = robot("panda")
    first, *_, last = bot.shapes
    far = [(first, last)]
    monkeypatch.setattr(module, "SYMBOLIC_PAIRS", 3)
    plain = SelfCollision(far, closest=2, corners=0)
    assert [row.label for row in plain.rows(bot)] == ["closest[0]", "closest[1]"]
    with pytest.raises(RangeError, match=r"SelfCollision\.pairs: more than 3 pairs.*method='sensed'.*got 4"):
        SelfCollision(far, method="symbolic").validate(bot)
    crowd = bot.with_shapes(dict.fromkeys(far[0], (BALL,) * 150))
    with pytest.raises(RangeError, match=rf"SelfCollision\.pairs.*{MAX_PAIRS}.*got 22500"):
        SelfCollision(far).validate(crowd)


def test_robots_without_such_shapes_are_refused() -> None:
    bot = robot("panda")
    first, *_, last = bot.shapes
    with pytest.raises(MissingShapeError) as caught:
        SelfCollision([(first, BARE)]).validate(bot)
    assert set(caught.value.choices) == set(bot.shapes)
    welded = bot.with_shapes({"panda_hand": (BALL,), "panda_hand_tcp": (BALL,)})
    hands = SelfCollision([("panda_hand", "panda_hand_tcp")])
    assert_refused(lambda: hands.validate(welded), RangeError, "no joint moves these links against each other")
    for bare in (bot.with_shapes({}), welded.with_self_pairs(None), bot.with_shapes({last: (BALL,)})):
        with pytest.raises(MissingShapeError, match="no pair of links"):
            SelfCollision().validate(bare)
    with pytest.raises(ShapeError, match=r"Box and Convex have no expression; use method='sensed'"):
        SelfCollision([("panda_link0", "panda_link4")], method="symbolic").validate(boxed())
