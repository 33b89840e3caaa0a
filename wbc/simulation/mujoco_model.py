"""A MuJoCo model made from a robot: the same joints, masses, limits and shapes under the same names."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from wbc import extras, validation
from wbc.errors import RangeError, UnsupportedJointError
from wbc.multibody import pin
from wbc.robot import JointCurve, Robot
from wbc.robot.robot import checked_robot
from wbc.rotations import TO_MUJOCO, quaternion
from wbc.shapes import PlacedShape
from wbc.simulation.dynamics import AXIS
from wbc.simulation.plant import CommandKind
from wbc.symbolic.joints import motion_at
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

#: Mass and moments of a body that has none, which MuJoCo does not take [kg, kg m^2]
NOTHING = 1e-12
#: Time constant of what stands for something rigid, in time steps: fewer do not hold
SOFT = 2.0
#: Impedance of what stands for something rigid (``solimp``), the largest that MuJoCo takes
HARD = (0.9999, 0.9999, 0.001, 0.5, 2.0)
#: Coefficients of a polynomial that a joint can follow
POWERS = 5
#: Bit of what is touched: the ground and objects
_TOUCHED = 1
#: Bit of what touches: shapes of the robot, which do not touch each other
_TOUCHING = 2


def mujoco_spec(
    robot: Robot,
    *,
    time_step: float = 0.001,
    actuators: str = "torque",
    frequency: float = 50.0,
    contacts: Mapping[str, Sequence[PlacedShape]] | None = None,
    ground: float | None = None,
    friction: float = 0.8,
    drawn: bool = True,
) -> mujoco.MjSpec:
    """What :func:`mujoco_model` compiles, to be added to before it is: objects, welds, cameras.

    Raises:
        As of :func:`mujoco_model`.
    """
    extras.require("mujoco", "a MuJoCo model")
    import mujoco

    robot = checked_robot(robot)
    spec = mujoco.MjSpec()
    spec.modelname = robot.name or "robot"
    spec.option.timestep = validation.scalar("time_step", time_step, low=0.0, open_low=True, unit="s")
    spec.option.gravity = np.array(robot.model.gravity.linear)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compiler.degree = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    bodies = _add_bodies(spec, robot)
    _add_shapes(spec, robot, bodies, robot.shapes if drawn else {}, touching=False, friction=friction)
    validation.scalar("friction", friction, low=0.0)
    _add_shapes(spec, robot, bodies, contacts or {}, touching=True, friction=friction)
    if ground is not None:
        plane = spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
        plane.pos = [0.0, 0.0, validation.scalar("ground", ground, unit="m")]
        plane.contype, plane.conaffinity, plane.friction[0] = _TOUCHED, _TOUCHING, friction
        plane.rgba = [0.85, 0.87, 0.9, 1.0]
    _add_couplings(spec, robot)
    _add_loops(spec, robot, bodies)
    _add_actuators(spec, robot, actuators, frequency)
    return spec


def mujoco_model(
    robot: Robot,
    *,
    time_step: float = 0.001,
    actuators: str = "torque",
    frequency: float = 50.0,
    contacts: Mapping[str, Sequence[PlacedShape]] | None = None,
    ground: float | None = None,
    friction: float = 0.8,
    drawn: bool = True,
) -> mujoco.MjModel:
    """The robot in MuJoCo, for ``MujocoPlant(model, robot)``.

        feet = {"left_sole": [PlacedShape(Box((0.2, 0.13, 0.02)), pin.SE3.Identity())]}
        plant = MujocoPlant(mujoco_model(robot, contacts=feet, ground=0.0), robot)

    Joints and actuators have the names of the robot's joints, each body that of its first link that is where the joint
    is, else the joint's. Without contacts its motion is Pinocchio's: armatures and gravity are the model's, damping and
    friction of joints are 0. Joints that follow others, and closed loops, are constraints of MuJoCo, as hard as it has
    them: 1e-4 of an acceleration is lost.

    Args:
        robot: on a base that is fixed or floats. time_step: [s].
        actuators: of every joint with one degree of freedom that a motor drives: ``"torque"`` within limits of effort,
            ``"position"`` or ``"velocity"`` with gains from the inertia at the robot's neutral configuration and a
            frequency [1/s].
        contacts: frame -> shapes fixed to it that touch the ground and objects; nothing else of the robot touches.
        ground: height of a floor [m]; None: none. friction: coefficient, of the floor and of the contacts.
        drawn: whether the robot's own shapes are in it, to be seen; they weigh and touch nothing.

    Raises:
        MissingPackageError: MuJoCo is not installed.
        UnsupportedJointError: a joint that MuJoCo has none for: planar and helical ones, and composites; a joint that
            follows a polynomial of more than the fourth degree; a loop that a slide closes.
        RangeError: inertias that MuJoCo refuses, and why; a time step or a friction out of range.
        UnknownNameError: no such kind of actuator, or frame.
    """
    spec = mujoco_spec(
        robot, time_step=time_step, actuators=actuators, frequency=frequency, contacts=contacts, ground=ground,
        friction=friction, drawn=drawn,
    )  # fmt: skip
    try:
        return spec.compile()
    except ValueError as error:
        raise RangeError("robot", robot.name, f"MuJoCo does not take it: {error}") from error


def _add_bodies(spec: mujoco.MjSpec, robot: Robot) -> list[mujoco.MjsBody]:
    """A body a joint, the world's first."""
    import mujoco

    model, limits, bodies = robot.model, robot.limits, [spec.worldbody]
    links: dict[int, str] = {}
    elsewhere: set[str] = set()
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY:
            if frame.placement.isIdentity():
                links.setdefault(int(frame.parentJoint), str(frame.name))
            else:
                elsewhere.add(str(frame.name))
    taken: set[str] = set()
    for j in range(1, model.njoints):
        name, place, inertia = str(model.names[j]), model.jointPlacements[j], model.inertias[j]
        body = bodies[int(model.parents[j])].add_body(pos=place.translation, quat=quaternion(place.rotation)[TO_MUJOCO])
        more = (f"{name} {k}" for k in itertools.count(1))
        choices = itertools.chain((links.get(j, name), name), more)
        body.name = next(one for one in choices if one not in taken and one not in elsewhere)
        taken.add(body.name)
        bodies.append(body)
        moments = np.array(inertia.inertia)
        if not np.trace(moments) > NOTHING:
            moments = moments + NOTHING * np.eye(3)
        body.explicitinertial, body.mass, body.ipos = True, max(inertia.mass, NOTHING), np.array(inertia.lever)
        body.fullinertia = moments[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        start, kind = int(model.idx_vs[j]), model.joints[j].shortname().removeprefix("JointModel")
        if kind == "FreeFlyer":
            if int(model.parents[j]) or not place.isIdentity():
                raise UnsupportedJointError("robot", name, "MuJoCo has free joints at the origin of the world alone")
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_FREE)
            continue
        if kind == "Spherical":
            body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL, armature=float(model.armature[start]))
            continue
        linear, angular = _axes(model.joints[j], int(model.nvs[j]), int(model.nqs[j]), name, kind)
        turns = bool(angular.any())
        joint = body.add_joint(
            name=name,
            type=mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE,
            axis=angular if turns else linear,
            armature=float(model.armature[start]),
        )
        low, high = float(limits.position_lower[start]), float(limits.position_upper[start])
        if low < high and np.isfinite([low, high]).all():
            joint.limited, joint.range = mujoco.mjtLimited.mjLIMITED_TRUE, [low, high]
    return bodies


def _axes(joint: pin.JointModel, nv: int, nq: int, name: str, kind: str) -> tuple[Array, Array]:
    """(linear, angular) motion of a joint of one degree of freedom, one of them zero."""
    if nv != 1 or kind == "Mimic":
        raise UnsupportedJointError("robot", name, f"MuJoCo has no joint like {kind}")
    twist = motion_at(joint, np.array([0.0]) if nq == 1 else np.array([1.0, 0.0]))[0]
    if twist[:3].any() and twist[3:].any():
        raise UnsupportedJointError("robot", name, "MuJoCo has no helical joint")
    return twist[:3], twist[3:]


def _add_shapes(
    spec: mujoco.MjSpec,
    robot: Robot,
    bodies: Sequence[mujoco.MjsBody],
    shapes: Mapping[str, Sequence[PlacedShape]],
    *,
    touching: bool,
    friction: float,
) -> None:
    """Geoms without mass on the bodies of their frames."""
    for name, placed in shapes.items():
        frame = robot.model.frames[frame_index(robot.model, robot.check_frame("contacts", name))]
        for k, one in enumerate(placed):
            validation.instance(f"contacts[{name!r}]", one, PlacedShape, "a PlacedShape")
            place = frame.placement * one.placement
            geom = bodies[int(frame.parentJoint)].add_geom(
                pos=place.translation, quat=quaternion(place.rotation)[TO_MUJOCO], mass=0.0, group=1 if touching else 2
            )
            one.shape.become(geom, spec, f"{name} {k} {'touching' if touching else 'drawn'}")
            geom.contype, geom.conaffinity = (_TOUCHING, _TOUCHED) if touching else (0, 0)
            if touching:
                geom.name, geom.friction[0], geom.condim = f"{name} {k}", friction, 4
            geom.rgba = [0.35, 0.55, 0.8, 1.0] if touching else [0.65, 0.68, 0.72, 1.0]


def _add_couplings(spec: mujoco.MjSpec, robot: Robot) -> None:
    import mujoco

    for coupling in robot.couplings:
        names = [robot.dof_names[dof] for dof in (coupling.follower, coupling.leader)]
        equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT)
        equality.name1, equality.name2 = names
        equality.data[:5] = [coupling.offset, coupling.ratio, 0.0, 0.0, 0.0]


def _add_loops(spec: mujoco.MjSpec, robot: Robot, bodies: Sequence[mujoco.MjsBody]) -> None:
    import mujoco

    # A hinge is two places on its axis
    places: dict[str, tuple[float, ...]] = {"connect": (0.0,), "weld": (0.0,), "hinge": (0.0, AXIS)}
    for loop in robot.loops.loops:
        if isinstance(loop, JointCurve):
            # y = y0 + sum c_k (x - x0)^k in powers of x
            curve = Polynomial(loop.coefficients)(Polynomial([-loop.origin[1], 1.0])) + loop.origin[0]
            terms = np.trim_zeros(np.atleast_1d(curve.coef), "b")
            if len(terms) > POWERS:
                raise UnsupportedJointError("robot", loop.follower, f"MuJoCo has polynomials up to power {POWERS - 1}")
            equality = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT)
            equality.name1, equality.name2 = loop.follower, loop.leader or ""
            equality.data[:POWERS] = np.pad(terms, (0, POWERS - len(terms)))
            equality.name = loop.name
        elif loop.kind not in places:
            raise UnsupportedJointError("robot", loop.name, f"MuJoCo closes no loop by a {loop.kind}")
        else:
            kind = mujoco.mjtEq.mjEQ_WELD if loop.kind == "weld" else mujoco.mjtEq.mjEQ_CONNECT
            for number, along in enumerate(places[loop.kind]):
                equality = spec.add_equality(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE)
                equality.name = f"{loop.name} axis" if number else loop.name
                equality.name1, equality.name2 = sites = [f"{equality.name} {side}" for side in "ab"]
                for site, name in zip(sites, (loop.first, loop.second), strict=True):
                    frame = robot.model.frames[0 if name == WORLD else frame_index(robot.model, name)]
                    place, turn = frame.placement.act(np.array([0.0, 0.0, along])), frame.placement.rotation
                    body = bodies[int(frame.parentJoint)]
                    body.add_site(name=site, pos=place, quat=quaternion(turn)[TO_MUJOCO])
    for equality in spec.equalities:
        equality.solref, equality.solimp = [SOFT * spec.option.timestep, 1.0], HARD


def _add_actuators(spec: mujoco.MjSpec, robot: Robot, kind: str, frequency: float) -> None:
    import mujoco

    kind = validation.one_of("actuators", kind, [str(one) for one in CommandKind])
    frequency = validation.scalar("frequency", frequency, low=0.0, open_low=True, unit="1/s")
    inertia = np.diag(pin.crba(robot.model, robot.model.createData(), robot.neutral))
    for j in range(1, robot.model.njoints):
        start = int(robot.model.idx_vs[j])
        if int(robot.model.nvs[j]) != 1 or start not in robot.motors:
            continue
        name, effort = str(robot.model.names[j]), float(robot.limits.effort[start])
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        if kind == CommandKind.TORQUE:
            actuator.set_to_motor()
        elif kind == CommandKind.POSITION:
            actuator.set_to_position(kp=frequency**2 * inertia[start], kv=2.0 * frequency * inertia[start])
        else:
            actuator.set_to_velocity(kv=frequency * inertia[start])
        if np.isfinite(effort) and effort > 0.0:
            actuator.forcelimited, actuator.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-effort, effort]
