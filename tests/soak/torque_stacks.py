"""Random stacks that command torques: contacts, wheels, loads, gears, drives, and motors of any strength."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

import wbc
from tests.soak.machines import machine
from tests.soak.stacks import DT, pose, weight
from wbc.api import Controller
from wbc.robot import Coupling, Robot
from wbc.robot.transmission import Transmission
from wbc.shapes import HalfSpace, Sphere
from wbc.tasks import (
    CenterOfMass,
    DivergentComponent,
    DriveTorqueLimits,
    EndEffector,
    ExternalWrench,
    JointCoupling,
    JointFriction,
    JointLimits,
    LineContact,
    Momentum,
    Obstacle,
    PointContact,
    Posture,
    RigidGrasp,
    RollingContact,
    SlidingContact,
    SurfaceContact,
    TorqueLimits,
    WrenchSum,
)
from wbc.tasks._contact import Contact, ContactForce
from wbc.validation import Array

#: Axes of the joints that can turn a wheel
AXES = {"RX": (1.0, 0.0, 0.0), "RY": (0.0, 1.0, 0.0), "RZ": (0.0, 0.0, 1.0)}


def strong(rng: np.random.Generator, more: bool = True) -> Robot:
    """A random robot with motors from much too weak to more than strong enough, and a frame ``w0`` ... in every hinge.

    With ``more`` some joints may follow another.
    """
    robot = machine(rng)
    effort = 10.0 ** rng.uniform(0.0, 3.0, robot.nv)
    effort[: robot.base_nv] = np.inf
    acceleration = robot.limits.acceleration.copy()
    acceleration[: robot.base_nv] = np.inf
    if rng.random() < 0.3:
        robot.model.gravity.linear = np.zeros(3)
    for frame in list(robot.model.frames):
        if str(frame.name).startswith("f"):
            origin = pin.Frame(f"w{frame.name[1:]}", frame.parentJoint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
            robot.model.addFrame(origin)
    kept = ("position_lower", "position_upper", "velocity")
    limits = {name: getattr(robot.limits, name) for name in kept}
    made = wbc.robots.load(robot.model).with_shapes(robot.shapes)
    made = made.with_limits(**limits, acceleration=acceleration, effort=effort)
    (other,) = rng.spawn(1)
    return led(made, other) if more and other.random() < 0.3 else made


def plain(robot: Robot) -> list[int]:
    """Degrees of freedom with a motor and a coordinate of their own."""
    followers = {c.follower for c in robot.couplings}
    return [i for i in range(robot.base_nv, robot.nv) if robot.position_index[i] >= 0 and i not in followers]


def led(robot: Robot, rng: np.random.Generator) -> Robot:
    """One or two joints follow another by a random ratio, each within limits of its own."""
    dofs = rng.permutation(plain(robot))[: int(rng.integers(2, 4))]
    ratios = rng.choice([-1.0, 1.0], 3) * 10.0 ** rng.uniform(-1.0, 1.0, 3)
    pairs = zip(dofs[1:], ratios, strict=False)
    return replace(robot, couplings=tuple(Coupling(int(k), int(dofs[0]), float(ratio)) for k, ratio in pairs))


def followed(robot: Robot, q: Array, v: Array) -> tuple[Array, Array]:
    """The state in which joints that follow are where the others put them."""
    q, v, places = q.copy(), v.copy(), robot.position_index
    for one in robot.couplings:
        q[places[one.follower]] = one.ratio * q[places[one.leader]] + one.offset
        v[one.follower] = one.ratio * v[one.leader]
    return q, v


def wheel(robot: Robot, rng: np.random.Generator) -> Contact | None:
    """One of the hinges as a wheel."""
    hinges = [k for k, j in enumerate(robot.model.joints) if j.shortname().removeprefix("JointModel") in AXES]
    frames = [f for f in robot.model.frames if str(f.name).startswith("w") and f.parentJoint in hinges]
    if not frames:
        return None
    frame = frames[int(rng.integers(len(frames)))]
    axis = AXES[robot.model.joints[frame.parentJoint].shortname().removeprefix("JointModel")]
    return RollingContact(
        str(frame.name), radius=float(rng.uniform(0.02, 0.3)), axis=axis, friction=rng.uniform(0, 1.5)
    )


def drives(robot: Robot, rng: np.random.Generator) -> tuple[Robot, DriveTorqueLimits | None]:
    """Two joints are moved by two drives of a random matrix; their own limits of torque are none."""
    joints = [robot.model.names[robot.model.joints[k].id] for k in range(2, robot.model.njoints)]
    single = [str(n) for n in joints if robot.model.idx_vs[robot.model.getJointId(n)] in plain(robot)]
    if len(single) < 2:
        return robot, None
    first, second = (str(name) for name in rng.choice(single, 2, replace=False))
    while np.linalg.cond(matrix := rng.normal(size=(2, 2))) > 1e3:
        pass
    made = Transmission((first, second), {n: {first: r[0], second: r[1]} for n, r in zip("ab", matrix, strict=True)})
    effort = robot.limits.effort.copy()
    effort[[robot.model.idx_vs[robot.model.getJointId(n)] for n in (first, second)]] = np.inf
    most = tuple(float(x) for x in 10.0 ** rng.uniform(0.0, 3.0, 2))
    return robot.with_limits(effort=effort), DriveTorqueLimits(made, torque=most)


def torque_stack(robot: Robot, rng: np.random.Generator, more: bool = True) -> wbc.Stack:
    """Limits of joints and torques, and a random choice of contacts, loads, margins and tasks.

    With ``more`` there are drives, slew rates, wheels, sums of wrenches and tasks of momentum; without them the same
    seeds give the other items all the same.
    """
    (other,) = rng.spawn(1)
    names = [str(frame.name) for frame in robot.model.frames if str(frame.name).startswith("f")]

    def frame() -> str:
        return str(rng.choice(names))

    def some(probability: float) -> bool:
        return bool(rng.random() < probability)

    def also(probability: float) -> bool:
        return more and bool(other.random() < probability)

    robot, wrist = drives(robot, other) if also(0.3) else (robot, None)
    stack = wbc.Stack(robot, dt=DT)
    for k in range(int(rng.integers(1, 3))):
        kind = str(rng.choice(["pose", "position", "orientation"]))
        stack.add(EndEffector(frame(), kind=kind), name=f"hand{k}", weight=weight(rng))
    stack.add(Posture(), name="posture", weight=weight(rng), level=int(some(0.2)))
    slew = float(10.0 ** other.uniform(1.0, 5.0)) if also(0.4) else None
    stack.add(JointLimits(), name="limits").add(TorqueLimits(slew=slew), name="motors")
    if wrist is not None:
        stack.add(wrist, name="wrist")
    made = []
    for k in range(int(rng.choice([0, 1, 2, 3]))):
        at = frame()
        contact: Contact = [
            RigidGrasp(at, force=float(10.0 ** rng.uniform(0, 3)), torque=float(10.0 ** rng.uniform(0, 2))),
            PointContact(at, friction=float(rng.uniform(0.0, 1.5)), least=float(rng.choice([0.0, 5.0]))),
            SurfaceContact(at, half_lengths=(0.1, 0.05), friction=float(rng.uniform(0.0, 1.5))),
            LineContact(at, half_length=0.1, friction=float(rng.uniform(0.0, 1.5))),
            SlidingContact(at, friction=float(rng.uniform(0.0, 0.5))),
        ][int(rng.integers(5))]
        if also(0.2):
            contact = wheel(robot, other) or contact
        made.append(f"contact{k}")
        stack.add(contact, name=made[-1])
    if len(made) >= 2 and also(0.5):
        stack.add(WrenchSum(tuple(made[:2])), name="sum", soft=weight(other) if also(0.5) else None)
    if some(0.3):
        stack.add(ExternalWrench(frame()), name="push")
    if some(0.3):
        stack.add(JointFriction(viscous=0.1, coulomb=0.2), name="gears")
    if some(0.3):
        stack.add(Obstacle(Sphere(0.1), margin=0.01), name="ball")
    if some(0.2):
        stack.add(Obstacle(HalfSpace()), name="floor", soft=weight(rng) if some(0.5) else None)
    for name, item in (
        ("balance", CenterOfMass()),
        ("capture", DivergentComponent(omega=3.0)),
        ("spin", Momentum("angular")),
    ):
        if also(0.15):
            stack.add(item, name=name, weight=weight(other))
    if also(0.2):
        joints = [robot.dof_names[i] for i in plain(robot)]
        if len(joints) >= 2:
            one, two = (str(name) for name in other.choice(joints, 2, replace=False))
            stack.add(JointCoupling({one: 1, two: -2}), name="geared", weight=weight(other))
    return stack


def provoke(controller: Controller, rng: np.random.Generator) -> None:
    """Other run-time values: contacts close and break, motors weaken, loads come and go."""
    for entry in controller.stack.entries:
        handle, item = controller[entry.name], entry.item
        if isinstance(item, EndEffector):
            place = pose(rng, 0.5 if rng.random() < 0.8 else 50.0)
            handle.target = {"pose": place, "orientation": place.rotation, "position": place.translation}[item.kind]
        elif isinstance(item, Contact):
            handle.enabled = bool(rng.random() < 0.8)
            if not isinstance(item, RollingContact) and rng.random() < 0.2:
                # where the frame is not: a contact that closes late or is misplaced
                handle.target = handle.target * pose(rng, 10.0 ** rng.uniform(-4.0, -1.0))
        elif isinstance(item, ContactForce):
            handle.weight = weight(rng)
            handle.target = 10.0 ** rng.uniform(-1.0, 3.0) * rng.normal(size=item.contact.components)
        elif isinstance(item, TorqueLimits):
            handle.scale = float(rng.choice([1.0, 1.0, 1.0, 0.3, 0.0]))
            count = len(item.dofs(controller.stack.robot))
            if item.slew is not None and count:  # a robot of which no motor has a rating has no slew rates to set
                handle.slew = 10.0 ** rng.uniform(0.0, 5.0, count)
        elif isinstance(item, DriveTorqueLimits):
            handle.scale = float(rng.choice([1.0, 1.0, 1.0, 0.3, 0.0]))
        elif isinstance(item, JointFriction):
            count = len(item.dofs(controller.stack.robot))
            handle.set(viscous=10.0 ** rng.uniform(-2, 1, count), coulomb=10.0 ** rng.uniform(-2, 1, count))
        elif isinstance(item, WrenchSum):
            handle.target = 10.0 ** rng.uniform(-1.0, 2.0) * rng.normal(size=6)
        elif isinstance(item, ExternalWrench):
            handle.wrench = 10.0 ** rng.uniform(-1.0, 2.0) * rng.normal(size=6)
        elif isinstance(item, Obstacle):
            handle.pose = pose(rng, 0.6)
        if entry.is_task and entry.name != "rest" and not isinstance(item, ContactForce):
            handle.weight = weight(rng)
