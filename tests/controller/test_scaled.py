"""Tasks that are slowed down and never turned aside, against bounded least squares and in closed loop."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.softness import Wish, jacobian, optimum
from tests.controller.stacks import DT, robot
from wbc.api import Controller, Stack
from wbc.controller import Status
from wbc.errors import DuplicateNameError, RangeError, ShapeError
from wbc.tasks import AxisAlign, Damping, Elbow, EndEffector, Hold, JointLimits, Posture

TIP, MIDDLE = "panda_hand_tcp", "panda_link4"
Q = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])


def slow(scaled: bool, calm: bool = True, elbow: int | None = None) -> Stack:
    """A hand on joints of 0.3 rad/s."""
    out = Stack(robot("panda").with_limits(velocity=0.3, acceleration=20.0), DT, calm=calm)
    out.add(EndEffector(TIP, kind="position"), name="hand", scaled=scaled)
    out.add(Posture(), name="posture", weight=1e-3, level=elbow or 0)
    if elbow is not None:
        out.add(Elbow(MIDDLE), name="elbow", weight=0.1, scaled=scaled, level=elbow)
    return out.add(JointLimits(acceleration=calm, position=calm), name="limits")


@pytest.fixture(scope="module", params=(IN_PYTHON, COMPILED))
def two(request: pytest.FixtureRequest) -> Controller:
    """Two scaled tasks that compete, on velocity limits alone."""
    return slow(True, calm=False, elbow=0).compile(**way(request.param))


def test_the_command_is_the_optimum_with_one_lambda_a_task(two: Controller) -> None:
    bot, unit, rng = two.stack.robot, two.stack.length**2, np.random.default_rng(1)
    seen = []
    for _ in range(15):
        q = np.asarray(pin.integrate(bot.model, Q, rng.uniform(-0.7, 0.7, 7)))
        two.reset(q)
        wishes = []
        for name, frame, weight in (("hand", TIP, float(10.0 ** rng.uniform(-1, 1))), ("elbow", MIDDLE, 0.3)):
            place, J = jacobian(bot, q, frame)
            two[name].target = place + rng.normal(0.0, 0.2, 3)
            two[name].weight = weight
            wishes.append(Wish(J, -two[name].gain * (place - two[name].target), weight / unit, scaled=True))
        wishes.append(Wish(np.eye(7), -two["posture"].gain * (q - two["posture"].target), 1e-3))
        step = two.step(q)
        v, (hand, elbow) = optimum(-bot.limits.velocity, bot.limits.velocity, wishes, [])
        assert step.status is Status.SOLVED
        assert step.v == pytest.approx(v, abs=1e-6)
        assert step.scales == pytest.approx({"hand": hand, "elbow": elbow}, abs=1e-5)
        for wish, share in zip(wishes, (hand, elbow), strict=False):
            assert wish.J @ step.v == pytest.approx(share * wish.w, abs=1e-4)
        seen += [hand, elbow]
    assert min(seen) < 0.5
    assert min(seen) >= 0.0
    assert max(seen) <= 1.0


def along_the_line(controller: Controller, ticks: int = 400) -> tuple[float, float, np.ndarray]:
    """How far a hand leaves the straight line to a target half a metre away, what is left of it, and all lambdas."""
    bot, q = controller.stack.robot, Q
    controller.reset(q)
    start = jacobian(bot, q, TIP)[0]
    line = np.array([-0.15, 0.5, 0.1])
    controller["hand"].target = start + line
    beside, shares = 0.0, []
    for _ in range(ticks):
        step = controller.step(q)
        assert step.status is Status.SOLVED
        shares.append(step.scales.get("hand", 1.0))
        q = pin.integrate(bot.model, q, step.v * DT)
        gone = jacobian(bot, q, TIP)[0] - start
        beside = max(beside, float(np.linalg.norm(gone - line * (gone @ line) / (line @ line))))
    return beside, float(np.linalg.norm(start + line - jacobian(bot, q, TIP)[0])), np.array(shares)


@pytest.mark.parametrize("backend", [IN_PYTHON, COMPILED])
def test_a_hand_that_is_asked_for_too_much_goes_straight(backend: str) -> None:
    beside, left, shares = along_the_line(slow(True).compile(**way(backend)))
    assert beside < 5e-4, "second order of a step, 0.38 mm when this was written"
    assert left < 0.25
    assert shares.min() < 0.2
    assert np.abs(np.diff(shares[20:])).max() < 0.02, "no chatter"


def test_without_the_option_it_leaves_the_line() -> None:
    beside, _, _ = along_the_line(slow(False).compile(backend=COMPILED))
    assert beside > 0.03, "41 mm when this was written"


def test_weights_masks_and_switches_of_the_task_count_for_its_direction(two: Controller) -> None:
    bot, hand = two.stack.robot, two["hand"]
    two.reset(Q)
    two["elbow"].enabled = False
    hand.weight = 1.0
    place, J = jacobian(bot, Q, TIP)
    hand.target = place + np.array([0.4, 0.4, -0.3])

    def turned() -> float:
        """How far the hand's velocity in the plane is turned from the target."""
        at = J @ two.step(Q).v
        return float(abs(at[0] - at[1]))

    assert turned() < 1e-5
    hand.mask = [1, 0, 1]
    assert turned() > 1e-2
    at = J @ two.step(Q).v
    assert 0.3 * at[0] == pytest.approx(-0.4 * at[2], abs=1e-6)
    hand.mask = 1
    two["hand direction"].enabled = False
    assert turned() > 1e-3
    two["hand direction"].enabled = True
    assert turned() < 1e-5
    hand.enabled = False
    posture = two.step(Q).v
    hand.enabled = True
    hand.weight = 0.0
    assert two.step(Q).v == pytest.approx(posture, abs=1e-9)
    assert two.step(Q).v == pytest.approx(np.zeros(7), abs=1e-9), "nothing is kept of a task that is off"
    hand.ramp(1.0, 0.05)
    for _ in range(11):
        assert turned() < 1e-5
    two["elbow"].enabled = True


def test_scaled_tasks_at_strict_levels() -> None:
    out = slow(True, elbow=1)
    bot, q = out.robot, Q
    both = [out.compile(**way(backend)) for backend in (IN_PYTHON, COMPILED)]
    targets = {"hand": (TIP, np.array([-0.15, 0.5, 0.1])), "elbow": (MIDDLE, np.array([0.0, 0.0, 0.3]))}
    for c in both:
        c.reset(q)
        for name, (frame, by) in targets.items():
            c[name].target = jacobian(bot, q, frame)[0] + by
    for _ in range(40):
        steps = [c.step(q) for c in both]
        assert [s.status for s in steps] == [Status.SOLVED] * 2
        assert steps[0].v == pytest.approx(steps[1].v, abs=1e-7)
        place, J = jacobian(bot, q, TIP)
        wish = -both[0]["hand"].gain * (place - both[0]["hand"].target)
        assert J @ steps[0].v == pytest.approx(steps[0].scales["hand"] * wish, abs=1e-5)
        q = pin.integrate(bot.model, q, steps[0].v * DT)
    assert 0.1 < steps[0].scales["hand"] < 0.9
    alone = slow(True).compile(solver=IN_PYTHON)
    alone.reset(Q)
    alone["hand"].target = jacobian(bot, Q, TIP)[0] + targets["hand"][1]
    both[0].reset(Q)
    assert alone.step(Q).scales["hand"] == pytest.approx(both[0].step(Q).scales["hand"], abs=1e-3)


def test_the_explanation_names_the_share(two: Controller) -> None:
    two.reset(Q)
    two["hand"].target = jacobian(two.stack.robot, Q, TIP)[0] + np.array([0.4, 0.4, -0.3])
    step = two.step(Q)
    found = step.explain()
    assert dict(found.scales)["hand"] == step.scales["hand"]
    assert "hand keeps its direction at" in str(found)
    assert not any(side.item.endswith("direction") for side in found.binding)
    assert "hand direction" in str(two)


def test_a_task_with_rows_of_its_own_keeps_its_direction() -> None:
    """An axis on joints of 0.05 rad/s turns straight to its target, the shortest way; by least squares it does not."""
    bot, rng, turned = (
        robot("panda").with_limits(velocity=0.05, acceleration=np.inf),
        np.random.default_rng(2),
        [0.0] * 2,
    )
    stacks = [Stack(bot, DT, calm=False).add(AxisAlign(TIP), name="axis", scaled=kept) for kept in (False, True)]
    made = [stack.add(JointLimits(), name="limits").compile(backend="vm") for stack in stacks]
    for _ in range(8):
        q, target = Q + rng.uniform(-0.3, 0.3, 7), rng.normal(size=3)
        target /= np.linalg.norm(target)
        for k, controller in enumerate(made):
            controller.reset(q)
            controller["axis"].target = target
            later = pin.integrate(bot.model, q, controller.step(q).v * 1e-4)
            before, after = (bot.pose(at, TIP).rotation[:, 2] for at in (q, later))
            way, moved = target - before * (before @ target), after - before
            size = np.linalg.norm(way) * np.linalg.norm(moved)
            turned[k] = max(turned[k], float(np.arccos(np.clip(way @ moved / size, -1.0, 1.0))))
    assert turned[0] > 0.1
    assert turned[1] < 1e-3


def test_bad_declarations_are_refused() -> None:
    out = Stack(robot("panda"), DT)
    for item in (Hold(TIP), Damping(), JointLimits()):
        with pytest.raises(RangeError, match="scaled"):
            out.add(item, scaled=True)
    with pytest.raises(ShapeError, match="scaled"):
        out.add(EndEffector(TIP), scaled="yes")  # type: ignore[arg-type]
    out.add(Posture(), name="hand direction")
    with pytest.raises(DuplicateNameError, match="hand direction"):
        out.add(EndEffector(TIP), name="hand", scaled=True)
    assert [e.name for e in out.entries] == ["hand direction"]
    other = wbc.Stack(robot("panda"), DT).add(EndEffector(TIP), name="hand", scaled=True)
    with pytest.raises(RangeError, match=r"hand direction.*inverse kinematics"):
        other.inverse_kinematics()


@pytest.mark.parametrize(("place", "gain"), [((2.0, 0.6, 0.3), 5.0), ((60.0, 20.0, 5.0), 100.0)])
def test_an_arm_at_the_end_of_its_line_rests_with_a_posture_at_a_level_below(place, gain) -> None:
    stack = Stack(robot("panda"), DT)
    stack.add(EndEffector(TIP, kind="position"), name="hand", scaled=True)
    stack.add(Posture(), name="posture", weight=1e-3, level=1)
    arm = stack.add(JointLimits(), name="limits").compile(backend=COMPILED)
    arm.reset(Q)
    arm["hand"].target, arm["hand"].gain = place, gain
    q, speeds = Q.copy(), []
    for _ in range(round(4.0 / DT)):
        step = arm.step(q)
        assert step.status is Status.SOLVED
        q = q + step.v * DT
        speeds.append(step.v)
    late = np.array(speeds[round(3.0 / DT) :])
    # without the force that keeps the direction in the curvature these were 0.7 and 1.8 rad/s
    assert np.abs(late).max() < 0.02
    assert (np.abs(np.diff(np.sign(np.where(np.abs(late) > 1e-3, late, 0.0)), axis=0)) < 2).all()
