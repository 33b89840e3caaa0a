"""Items in a moving frame: what they say is what they say of the robot as Pinocchio places it in that frame, and the
frame's twist is fed forward as finite differences have it. One walk over the registry, on all test robots.
"""

from __future__ import annotations

import pickle
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.evaluation import sample, slope
from tests.items import ITEMS
from tests.models import placement
from tests.repeats import MORE, repeats
from tests.tasks.robots import NAMES, random_configuration, robot
from wbc.errors import DuplicateNameError, RangeError, SolverError, UnknownNameError
from wbc.robot import Robot
from wbc.shapes import Box, Sphere
from wbc.stack import program
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.tasks import (
    AxisAlign,
    CenterOfMass,
    EndEffector,
    FrameVelocityLimit,
    Hold,
    Item,
    LookAt,
    MovingFrame,
    Obstacle,
    PitchPlane,
    Posture,
    Rolling,
    Task,
    inputs as run_time,
    registry,
)
from wbc.tasks._contact import Contact

#: Those that have no meaning for velocities are in the tests of accelerations
SECOND_ORDER = {"DivergentComponent"}
SHIPPED = {name: cls for name, cls in registry().items() if cls.__module__.startswith("wbc.tasks.")}
STANDING = sorted({name for name, cls in SHIPPED.items() if cls.stands_in_world} - SECOND_ORDER)
DT = 0.01
PANDA, UR5 = (wbc.robots.load(name) for name in ("panda", "ur5"))


class Program:
    """The tick's expressions of one item, in a moving frame or in the world, interpreted."""

    def __init__(self, machine: Robot, item: Item, moving: bool, command: str = "velocity") -> None:
        stack = Declaration(machine, DT, calm=False)
        if moving:
            stack.add(MovingFrame(), name="table")
        stack.add(item, name="item", relative_to="table" if moving else None)
        stack = stack.commanding(command)
        self.layout, self.machine = Layout(stack), machine
        with pytest.MonkeyPatch.context() as patch:
            # All rows as expressions, those too that a tick leaves to its loops
            patch.setattr(program, "loops", lambda _: False)
            self.rows = program.build(stack, self.layout).rows
        self.block = self.layout.blocks["item"]

    def __call__(
        self, q: np.ndarray, values: dict[str, Any], v: np.ndarray | None = None, dt: float = 0.0, **frame: Any
    ) -> dict[str, np.ndarray]:
        """``dt`` 0: rates at q itself, before what bends within a tick."""
        p = np.zeros(self.layout.parameters)
        for name, given in (("item", values), ("table", frame)):
            for slot in self.layout.blocks[name].slots.values() if name in self.layout.blocks else ():
                value = given.get(slot.input.name, slot.input.default)
                p[slot.span] = run_time.flat(self.machine, slot.input.name, slot.input, value)
        v = np.zeros(self.machine.nv) if v is None else v
        found = dict(zip(self.rows.name_out(), self.rows(q, v, p, dt), strict=True))
        span, task = self.block.span, self.block.form == "task"
        names = ("jt", "desired") if task else ("at", "low")
        out = {"jacobian": found[names[0]][:, span].T, "asked": found[names[1]][span]}
        if self.block.form != "rows":
            out["value"] = found["error"][span] if task else found["margin"][self.block.margins]
        return {name: np.array(value.full()) for name, value in out.items()}


def declared(class_name: str, machine: Robot) -> Iterator[tuple[Item, dict[str, Any]]]:
    """Items of a class whose other frame, if they have one, is the world, with random values."""
    rng = np.random.default_rng(zlib.crc32(class_name.encode()))
    for item, given in ITEMS[class_name](machine):
        drawn = {d.name: sample(machine, d, rng) for d in item.inputs(machine)}
        yield item, {"gain": 0.0, "rate": 1.0} | drawn | given


def close(found: np.ndarray, wanted: np.ndarray, tolerance: float) -> None:
    finite = np.isfinite(wanted)
    assert (np.isfinite(found) == finite).all()
    scale = max(1.0, float(np.abs(wanted[finite]).max(initial=0.0)))
    assert float(np.abs(found - wanted)[finite].max(initial=0.0)) <= tolerance * scale


def somewhere(seed: int) -> pin.SE3:
    """A pose like any other."""
    rng = np.random.default_rng(seed)
    return pin.SE3(pin.exp3(rng.uniform(-1.8, 1.8, 3)), rng.uniform(-1.0, 1.0, 3))


FLOATING = [name for name, cls in SHIPPED.items() if issubclass(cls, (Hold, FrameVelocityLimit, Rolling, Contact))]


def walk(class_name: str) -> Iterator[tuple[Robot, Item, dict[str, Any]]]:
    """Items of a class: some on one robot, or all on every robot, see ``make test REPEATS=3``; in plain rows what the
    frame does is read off a floating base.
    """
    names = ("talos",) if class_name in FLOATING else NAMES[:3]
    few = MORE < 2.0
    for name in [names[zlib.crc32(class_name.encode()) % len(names)]] if few else names:
        items = list(declared(class_name, robot(name)))
        yield from ((robot(name), *one) for one in items[:: (1 + len(items) // 2) if few else 1])


@pytest.mark.parametrize("class_name", STANDING)
def test_an_item_sees_the_robot_from_the_frame_and_feeds_its_motion_forward(class_name: str) -> None:
    """Value and Jacobian are those of Pinocchio's model placed in the frame; the rate that is asked for is less by what
    the frame's motion alone does to the value: a finite difference, or for plain rows the motion of a floating base.
    Accelerations that are asked for are held to these rates.
    """
    rng, floating = np.random.default_rng(1), class_name in FLOATING
    for machine, item, values in walk(class_name):
        q, pose, twist = random_configuration(machine, rng), somewhere(1), rng.uniform(-1.0, 1.0, 6)
        moving = Program(machine, item, moving=True)
        still = moving(q, values, pose=pose, twist=np.zeros(6))
        moved = moving(q, values, pose=pose, twist=twist)
        seen = Program(machine.seen_from(pose), item, moving=False)(q, values)
        for part in still:
            close(still[part], seen[part], 1e-8)
        drift = (still["asked"] - moved["asked"])[:, 0]
        if floating:
            close(drift, (still["jacobian"] @ rigid(machine, q, pose, twist)), 1e-8)
        elif not isinstance(item, Task) or type(item).jacobian is Task.jacobian:
            close(drift, slope(lambda t: _later(moving, q, values, pose, twist, t)), 1e-7)  # noqa: B023
        accelerations_are_derivatives(moving, item, values, rng)


def accelerations_are_derivatives(first: Program, item: Item, values: dict[str, Any], rng: np.random.Generator) -> None:
    """At a steady v, d/dt (J v - asked rate) of the tick of velocities, the frame's twist and pose moving, is what the
    tick of accelerations takes off.
    """
    machine, h = first.machine, 1e-5
    # A direction that moves at a steady rate does not keep its length
    if item.refusal(machine, "acceleration") or any(slot.input.direction for slot in first.block.slots.values()):
        return
    pose, (twist, push) = somewhere(2), rng.uniform(-0.5, 0.5, (2, 6))
    q, v = random_configuration(machine, rng), rng.uniform(-0.5, 0.5, machine.nv)
    given = values | dict.fromkeys(("gain", "rate", "stiffness", "damping"), 0.0)

    def rate(t: float) -> np.ndarray:
        there = pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
        later, moved = pin.integrate(machine.model, q, v * t), given | after(first, values, t)
        found = first(later, moved, pose=there, twist=twist + t * push)
        return np.asarray(found["jacobian"] @ v - found["asked"][:, 0])

    second = Program(machine, item, True, "acceleration")
    asked = second(q, given, v, DT, pose=pose, twist=twist, acceleration=push)["asked"][:, 0]
    finite = np.isfinite(asked)
    close(-asked[finite], ((rate(h) - rate(-h)) / (2.0 * h))[finite], 1e-5)


@pytest.mark.parametrize("class_name", STANDING)
def test_rows_in_a_frame_are_those_of_the_mean_of_a_tick_to_third_order(class_name: str) -> None:
    """Tasks, margins and plain rows of a gain of 0: J v less what is asked is the mean of the rates along the tick, by
    Simpson's rule; halving dt divides the difference over the tick by eight. Frame, inputs and joints move, the frame
    with an acceleration; v has changed since the last tick.
    """
    rng = np.random.default_rng(3)
    for machine, item, values in walk(class_name):
        moving, still = Program(machine, item, moving=True), values | {"gain": 0.0, "rate": 0.0}
        if any(slot.input.direction for slot in moving.block.slots.values()):
            continue
        q, pose, (twist, push) = random_configuration(machine, rng), somewhere(2), rng.uniform(-1.0, 1.0, (2, 6))
        v, change = rng.uniform(-1.0, 1.0, (2, machine.nv))
        off = []
        for dt in (4e-3, 2e-3):
            mean = twist + 0.5 * dt * push
            first, middle, last = (rate_along(moving, still, q, v, (pose, mean), t) for t in (0.0, 0.5 * dt, dt))
            asked = moving(q, still, v - dt * change, dt, pose=pose, twist=twist, acceleration=push)
            gone = dt * ((first + 4.0 * middle + last) / 6.0 - (asked["jacobian"] @ v - asked["asked"][:, 0]))
            off.append(np.abs(gone[np.isfinite(gone)]).max(initial=0.0))
        assert off[0] < 1e-6
        assert off[1] < off[0] / 6.0 + 1e-11


def rate_along(
    program: Program, values: dict[str, Any], q: np.ndarray, v: np.ndarray, frame: tuple[pin.SE3, np.ndarray], t: float
) -> np.ndarray:
    """Of the item's value, where joints, inputs and frame have moved for a time t at steady rates."""
    pose, twist = frame
    there = pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
    at = pin.integrate(program.machine.model, q, v * t)
    found = program(at, values | after(program, values, t), v, pose=there, twist=twist)
    return np.asarray(found["jacobian"] @ v - found["asked"][:, 0])


def after(program: Program, values: dict[str, Any], t: float) -> dict[str, Any]:
    """Inputs of the item that have a rate, t later."""
    out: dict[str, Any] = {}
    for name, slot in program.block.slots.items():
        if slot.input.rate is None or name not in values:
            continue
        rate = np.asarray(values.get(slot.input.rate, program.block.slots[slot.input.rate].input.default))
        if slot.input.kind == "pose":
            pose = pin.SE3(values[name])
            out[name] = pin.SE3(pin.exp3(t * rate[3:]) @ pose.rotation, pose.translation + t * rate[:3])
        elif slot.input.kind == "rotation":
            out[name] = pin.exp3(t * rate) @ values[name]
        else:
            out[name] = np.asarray(values[name]) + t * rate
    return out


def test_the_curvature_is_that_of_the_robot_placed_in_the_frame() -> None:
    machine, rng = robot("ur5"), np.random.default_rng(2)
    q, pose = random_configuration(machine, rng), somewhere(2)
    for item in (EndEffector("tool0"), AxisAlign("tool0"), CenterOfMass()):
        found, force = [], rng.uniform(-1.0, 1.0, len(item.rows(machine)))
        target = sample(machine, item.inputs(machine)[0], np.random.default_rng(3))
        for moving in (True, False):
            stack = Declaration(machine if moving else machine.seen_from(pose), DT)
            if moving:
                stack.add(MovingFrame(pose), name="table")
            stack.add(item, name="item", relative_to="table" if moving else None)
            layout = Layout(stack)
            p, blocks = np.zeros(layout.parameters), layout.blocks
            for slot, value in [(blocks["item"].slots["target"], target)] + (
                [(blocks["table"].slots["pose"], pose)] if moving else []
            ):
                p[slot.span] = run_time.flat(machine, slot.input.name, slot.input, value)
            curvature = program.build(stack, layout).curvature
            assert curvature is not None
            weights = np.concatenate([force, np.zeros(layout.general_rows)])
            found.append(curvature(q, np.zeros(machine.nv), p, DT, weights).full())
        close(found[0], found[1], 1e-9)
        assert np.abs(found[0]).max() > 1e-3


def _later(moving: Program, q: np.ndarray, values: dict[str, Any], pose: pin.SE3, twist: np.ndarray, t: float) -> Any:
    there = pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
    return moving(q, values, pose=there)["value"][:, 0]


def rigid(machine: Robot, q: np.ndarray, pose: pin.SE3, twist: np.ndarray) -> np.ndarray:
    """Velocity of a floating base that has the robot move as a frame with minus that twist would carry it."""
    data = machine.model.createData()
    pin.forwardKinematics(machine.model, data, q)
    base = data.oMi[1]
    linear = twist[:3] + np.cross(twist[3:], base.translation - pose.translation)
    v = np.zeros(machine.nv)
    v[:3], v[3:6] = -base.rotation.T @ linear, -base.rotation.T @ twist[3:]
    return v


def hand_on_a_table(
    machine: Robot = PANDA, tip: str = "panda_hand_tcp", dt: float = DT, kind: Callable[[str], Item] = EndEffector
) -> wbc.Controller:
    stack = wbc.Stack(machine, dt, calm=False).add(MovingFrame(), name="table")
    return stack.add(kind(tip), name="hand", relative_to="table").compile(backend="vm")


def test_robot_and_frame_that_stand_together_need_no_command_and_defaults_are_those_of_the_frame() -> None:
    controller, q = hand_on_a_table(), PANDA.neutral
    pose = somewhere(3)
    with pytest.raises(SolverError, match=r"table\.pose"):
        controller.step(q)
    controller["table"].pose = pose
    step = controller.step(q)
    assert np.abs(step.v).max() < 1e-9
    hand = placement(PANDA, "panda_hand_tcp", q)
    assert np.allclose(controller["hand"].target.homogeneous, pose.actInv(hand).homogeneous, atol=1e-12)


@pytest.mark.parametrize("command", ["acceleration", "torque"])
def test_a_hand_that_goes_with_the_frame_has_the_acceleration_of_its_point(command: str) -> None:
    """a_T + alpha x r + w x (w x r), by Pinocchio's classical acceleration at the command."""
    rng, tip = np.random.default_rng(0), PANDA.model.getFrameId("panda_hand_tcp")
    stack = wbc.Stack(PANDA, DT).add(MovingFrame(), name="table")
    stack.add(EndEffector("panda_hand_tcp", relative_to="table"), name="hand")
    controller, q = stack.compile(command=command, backend="vm"), PANDA.neutral + 0.1 * rng.normal(size=7)
    pose, (twist, push), data = somewhere(0), rng.uniform(-0.3, 0.3, (2, 6)), PANDA.model.createData()
    jacobian = pin.computeFrameJacobian(PANDA.model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)
    arm = pin.updateFramePlacement(PANDA.model, data, tip).translation - pose.translation
    (linear, spin), (thrust, turning) = twist.reshape(2, 3), push.reshape(2, 3)
    v = np.linalg.lstsq(jacobian, np.append(linear + np.cross(spin, arm), spin), rcond=None)[0]
    controller["table"].set(pose=pose, twist=twist, acceleration=push)
    pin.forwardKinematics(PANDA.model, data, q, v, controller.step(q, v).a)
    found = pin.getFrameClassicalAcceleration(PANDA.model, data, tip, pin.LOCAL_WORLD_ALIGNED).vector
    wanted = np.append(thrust + np.cross(turning, arm) + np.cross(spin, np.cross(spin, arm)), turning)
    assert np.allclose(found, wanted, atol=2e-6)
    assert np.linalg.norm(wanted) > 0.3


def off_by(kind: Callable[[str], Item], before: pin.SE3, now: pin.SE3) -> float:
    """How far an item is from where it was [m], of directions [rad], by the poses of its frame."""
    if kind in (EndEffector, Hold):
        return float(np.linalg.norm(before.actInv(now).translation))
    sight = before.rotation[:, 2]
    if kind is LookAt:
        sight = before.translation + PANDA.characteristic_length * sight - now.translation
    return float(np.linalg.norm(np.cross(now.rotation[:, 2], sight)) / np.linalg.norm(sight))


@pytest.mark.parametrize(
    ("kind", "seed"),
    [(EndEffector, s) for s in range(repeats(4))]
    + [(kind, 2 * s) for kind in (Hold, AxisAlign, LookAt) for s in range(repeats(1))],
)
def test_an_item_in_a_frame_that_turns_and_accelerates_stays_to_second_order(
    kind: Callable[[str], Item], seed: int
) -> None:
    """Within 0.01 mm, or 1e-5 rad, at 10 ms, up to 0.7 rad/s, 0.3 m/s^2 and 0.2 rad/s^2, after half a second; a fourth
    of it at 5 ms.
    """
    rng = np.random.default_rng(seed)
    machine, tip = ((PANDA, "panda_hand_tcp"), (UR5, "tool0"))[seed % 2]
    start = (
        np.array([0, -0.5, 0, -2.0, 0, 1.6, 0.8]) if machine is PANDA else np.array([0.3, -1.2, 1.6, -0.8, 0.9, 0.2])
    )
    spin, turning = rng.normal(size=(2, 3))
    spin, turning = rng.uniform(0.3, 0.7) * spin / np.linalg.norm(spin), 0.2 * turning / np.linalg.norm(turning)
    push = 0.3 * (aside := rng.normal(size=3)) / np.linalg.norm(aside)
    data, frame = machine.model.createData(), machine.model.getFrameId(tip)

    def hand(q: np.ndarray) -> pin.SE3:
        pin.framesForwardKinematics(machine.model, data, q)
        return data.oMf[frame].copy()

    origin = hand(start).translation + rng.uniform(-0.3, 0.3, 3)

    def table(t: float) -> pin.SE3:
        return pin.SE3(pin.exp3(t * spin + 0.5 * t * t * turning), origin + push * (0.5 * t * t - 0.5 * t))

    worst = []
    for dt in (0.01, 0.005):
        controller, q, off = hand_on_a_table(machine, tip, dt, kind), start, []
        kept = table(0.0).actInv(hand(q))
        for k in range(round(1.0 / dt)):
            t, h = k * dt, 1e-4
            # Central differences: of a rotation about a moving axis the rates have no short form
            rates = [(pin.log3(table(t + s + h).rotation @ table(t + s - h).rotation.T) / (2 * h)) for s in (-h, 0, h)]
            twist = np.append(push * (t - 0.5), rates[1])
            controller["table"].set(
                pose=table(t), twist=twist, acceleration=np.append(push, (rates[2] - rates[0]) / (2 * h))
            )
            q = pin.integrate(machine.model, q, controller.step(q).v * dt)
            off.append(off_by(kind, kept, table(t + dt).actInv(hand(q))))
        worst.append(max(off[len(off) // 2 :]))
    assert worst[0] < 1e-5
    assert worst[1] < 0.35 * worst[0] + 1e-7


@pytest.mark.parametrize("shape", [Sphere(0.05), Box((0.1, 0.2, 0.1))])
def test_an_obstacle_in_a_frame_is_the_obstacle_where_the_frame_has_it(shape: Any) -> None:
    """Rows that are expressions, that a sensor measures, and that a compiled tick would compute in a loop."""
    machine, rng = robot("panda"), np.random.default_rng(4)
    frame, local = somewhere(4), somewhere(5)
    drift, twist = rng.uniform(-0.3, 0.3, (2, 6))
    place = pin.SE3(np.eye(3), np.array([0.45, 0.0, 0.35]))
    local = frame.actInv(place * pin.SE3(local.rotation, np.zeros(3)))
    commands = []
    for moving in (True, False):
        # So short a tick that nothing bends within it
        stack = wbc.Stack(machine, 1e-6, calm=False).add(Posture(), name="posture")
        stack.add(MovingFrame(frame), name="table")
        stack.add(Obstacle(shape), name="post", relative_to="table" if moving else None)
        controller = stack.compile(backend="vm")
        if moving:
            controller["table"].twist = twist
            controller["post"].set(pose=local, velocity=drift)
        else:
            arm, turn = frame.rotation @ local.translation, frame.rotation
            linear = twist[:3] + np.cross(twist[3:], arm) + turn @ drift[:3]
            velocity = np.concatenate([linear, twist[3:] + turn @ drift[3:]])
            controller["post"].set(pose=frame * local, velocity=velocity)
        step = controller.step(machine.neutral)
        commands.append(step.v)
        assert np.abs(step.v).max() > 1e-3
    assert np.allclose(*commands, atol=1e-8)


def test_one_way_to_say_it_and_what_is_refused() -> None:
    machine = robot("panda")
    stack = wbc.Stack(machine, DT).add(MovingFrame(), name="table")
    hand = EndEffector("panda_hand_tcp", relative_to="table")
    stack.add(hand, name="hand")
    assert stack["hand"].frame == "table"
    controller = stack.compile(backend="vm")
    assert controller[hand] is controller["hand"]
    with pytest.raises(UnknownNameError, match="table"):
        stack.add(Obstacle(Sphere(0.1)), name="ball", relative_to="tabel")
    with pytest.raises(UnknownNameError):
        stack.add(AxisAlign("panda_hand_tcp", relative_to="deck"))
    with pytest.raises(RangeError, match="Posture"):
        stack.add(Posture(), relative_to="table")
    with pytest.raises(RangeError, match="table"):
        stack.add(MovingFrame(), name="deck").add(hand, name="two", relative_to="deck")
    with pytest.raises(DuplicateNameError, match="frame"):
        stack.add(MovingFrame(), name="panda_hand_tcp")
    with pytest.raises(UnknownNameError, match="table"):
        wbc.Stack(machine, DT).add(hand)


def test_the_rate_of_a_plane_is_that_past_the_frame() -> None:
    """A pitch plane's rate has no value to differentiate: a floating robot that turns with the frame turns no plane."""
    machine = robot("talos")
    item = next(i for i, _ in ITEMS["PitchPlane"](machine) if isinstance(i, PitchPlane) and i.commands_rate)
    moving, rng = Program(machine, item, moving=True), np.random.default_rng(0)
    q, pose, twist = random_configuration(machine, rng), somewhere(6), rng.uniform(-1.0, 1.0, 6)
    found = moving(q, {"target": 0.0, "gain": 0.0}, pose=pose, twist=twist)
    assert np.allclose(found["jacobian"] @ rigid(machine, q, pose, -twist), found["asked"][:, 0], atol=1e-9)


def test_a_stack_in_a_frame_is_compiled_pickled_and_solved_like_any_other() -> None:
    """A pickled one too, with a scaled task, a soft row and a lower level; poses that inverse kinematics finds in the
    frame are those that it finds in the world.
    """
    machine, pose, goal = wbc.robots.load("ur5"), somewhere(7), somewhere(8)
    stack = wbc.Stack(machine, DT).add(MovingFrame(pose), name="the table")
    stack.add(EndEffector("tool0", relative_to="the table"), name="hand", scaled=True)
    stack.add(FrameVelocityLimit("tool0", linear=0.3), name="speed", relative_to="the table", soft=10.0)
    stack.add(Posture(), level=1)
    commands = []
    for made in (stack, pickle.loads(pickle.dumps(stack))):
        controller = made.compile(backend="vm")
        controller["the table"].twist = [0.1, 0.2, -0.1, 0.3, 0.1, 0.0]
        commands.append(controller.step(machine.neutral + 0.3).v)
    assert np.abs(commands[0]).max() > 0.01
    assert np.allclose(*commands, atol=1e-12)
    place = pin.SE3(goal.rotation, np.array([0.4, 0.2, 0.4]))
    found = []
    for frame in ("table", "world"):
        solved = wbc.Stack(machine, DT)
        if frame == "table":
            solved.add(MovingFrame(pose), name="table")
        solved.add(EndEffector("tool0", relative_to=frame), name="hand")
        wanted = pose.actInv(place) if frame == "table" else place
        found.append(solved.solve(machine.neutral + 0.2, {"hand": wanted}).q)
    assert np.allclose(*found, atol=1e-9)
