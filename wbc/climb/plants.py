"""Plants of torques for a climber on its scene, with what the loop does not know of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wbc import extras, validation
from wbc.clearance import EndlessCylinder
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import FlatFoot
from wbc.climb.faults import FaultEvents, PlantFault, delay_of
from wbc.climb.loop.stack import contact_frame, contact_robot
from wbc.climb.scene import ClimbScene
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.shapes import Box, HalfSpace, PlacedShape, Solid, Sphere
from wbc.simulation import GrippingMujocoPlant, Motors, PinocchioPlant, mujoco_spec
from wbc.validation import Array

#: Radius of the ball at a point foot: its point of contact wanders by as much as it rolls [m]
BALL = 0.002
#: Thickness of a sole [m]
SOLE_THICKNESS = 0.01
#: Of a simulation [s]
TIME_STEP = 0.001
#: Time constant of contacts [s]
CONTACT_TIME = 4.0 * TIME_STEP
#: Ratio of the stiffness of friction to that of normal forces: feet creep less [1]
FRICTION_STIFFNESS = 10.0
#: Bit of what stands in the world, as of :func:`mujoco_spec`
TOUCHED = 1
#: Bit of what touches it
TOUCHING = 2
#: Half of what stands for a length without end [m]
ENDLESS = 100.0
#: Plants by name
PLANTS = ("kinematic", "pinocchio", "mujoco")


@dataclass(frozen=True)
class PlantErrors:
    """How a plant differs from what plan and loop count on.

    Attributes:
        friction: part of the feet's friction that there is.
        mass: largest relative error of each link's mass and inertia, drawn evenly.
        delay: of the torques [s].
        seed: of the draw.
        payload: mass on the body, at its origin [kg].
        rubbing: friction of every joint, Coulomb's and as much viscous one [N m, N m s; N, N s/m].
    """

    friction: float = 1.0
    mass: float = 0.0
    delay: float = 0.0
    seed: int = 0
    payload: float = 0.0
    rubbing: float = 0.0

    def __post_init__(self) -> None:
        validation.own_scalars(self, "mass", low=0.0, high=0.9)
        validation.own_scalars(self, "friction", "payload", "rubbing", "delay", low=0.0)

    def built(self, climber: Climber, gravity: Array) -> Robot:
        """The robot as it is, with the contact frames of its limbs.

        Raises:
            RangeError: a robot without masses.
        """
        if climber.mass <= 0.0:
            raise RangeError("climber", climber.name, "torques need a robot with masses")
        robot, drawn = contact_robot(climber, gravity), np.random.default_rng(self.seed)
        model = robot.model.copy()
        for k in range(1, model.njoints):
            share, one = 1.0 + self.mass * drawn.uniform(-1.0, 1.0), model.inertias[k]
            model.inertias[k] = pin.Inertia(share * one.mass, one.lever, share * one.inertia)
        if self.payload:
            model.inertias[1] += pin.Inertia(self.payload, np.zeros(3), np.zeros((3, 3)))
        return replace(robot, model=model)

    @property
    def motors(self) -> Motors:
        """Those of the plant."""
        return Motors(delay=self.delay, coulomb=self.rubbing, viscous=self.rubbing)


def climb_plant(
    name: str,
    climber: Climber,
    scene: ClimbScene,
    errors: PlantErrors | None = None,
    faults: Sequence[PlantFault] = (),
) -> ClimbPlant | RigidClimbPlant | None:
    """The plant of a name: ``kinematic`` (None), ``pinocchio`` or ``mujoco``; ``ClimbLoop(plan, plant,
    delay=plant.errors.delay)`` goes with it.

    Args:
        climber: what climbs. scene: what it climbs, its gravity too. errors, faults: of a plant of torques; a delay
            among the faults is one of ``errors``.

    Raises:
        UnknownNameError: no such plant, limb or joint. RangeError: errors or faults of the kinematic plant, two delays,
            feet on Pinocchio's plant, a robot without masses. What the plants raise.
    """
    validation.one_of("plant", name, PLANTS)
    errors, late = errors or PlantErrors(), delay_of(faults)
    if name == "kinematic":
        if faults or errors != PlantErrors(seed=errors.seed):
            raise RangeError("plant", name, "it has no masses and no motors, so no errors and no faults")
        return None
    if late and errors.delay:
        raise RangeError("fault", late, f"torques have a delay of {errors.delay:g} s already")
    errors = replace(errors, delay=late or errors.delay)
    return (ClimbPlant if name == "mujoco" else RigidClimbPlant)(climber, scene, errors, faults)


class RigidClimbPlant(PinocchioPlant):
    """Limbs grip as hard constraints (:class:`PinocchioPlant`); nothing else touches.

    Args:
        climber: what climbs, all of whose limbs grip. scene: its gravity counts. errors: None: none. faults: that come
            in time.

    Attributes:
        errors: as given.

    Raises:
        RangeError: a limb that only presses, a robot without masses. What :class:`PinocchioPlant` and
        :class:`FaultEvents` raise.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, errors: PlantErrors | None = None, faults: Sequence[PlantFault] = ()
    ) -> None:
        for limb in climber.limbs:
            if not limb.contact.pulls:
                raise RangeError("plant", limb.name, "feet need a plant with contacts, such as mujoco")
        self.errors, self._events = errors or PlantErrors(), FaultEvents(climber, faults)
        robot = self.errors.built(climber, scene.gravity)
        super().__init__(robot, TIME_STEP, integrator="midpoint", motors=self.errors.motors, seed=self.errors.seed)

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """As of :class:`PinocchioPlant`; no fault has come yet."""
        self._events.reset()
        super().reset(q, time, v)

    def advance(self, dt: float) -> None:
        """As of :class:`PinocchioPlant`, with the faults whose time has come."""
        self._events.happen(self, self._state.time)
        super().advance(dt)

    @property
    def contact_torques(self) -> Array:
        """J'w of all grips ``[nv]`` [N; N m]."""
        state, model, data = self._state, self.model, self._placed
        out = np.zeros(self.nv)
        pin.computeJointJacobians(model, data, state.q)
        for name, wrench in self.wrenches.items():
            out += pin.getFrameJacobian(model, data, model.getFrameId(name), pin.LOCAL).T @ wrench
        return out


class ClimbPlant(GrippingMujocoPlant):
    """Feet touch the scene's bodies in MuJoCo, with the friction of their limbs; limbs that pull are grips.

    A point foot is its ball, or one of 2 mm, a flat foot a box; no other part of the robot touches anything.

    Args:
        climber: what climbs. scene: what it climbs, its gravity too. errors: None: none. faults: that come in time.

    Attributes:
        errors: as given.

    Raises:
        MissingPackageError: MuJoCo is not installed. ShapeError: a body under feet that MuJoCo has no shape for.
        RangeError: a robot without masses. What :func:`mujoco_spec` and :class:`FaultEvents` raise.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, errors: PlantErrors | None = None, faults: Sequence[PlantFault] = ()
    ) -> None:
        extras.require("mujoco", "a climb in MuJoCo")
        import mujoco

        errors = self.errors = errors or PlantErrors()
        self._events = FaultEvents(climber, faults)
        robot = errors.built(climber, scene.gravity)
        feet = [limb for limb in climber.limbs if not limb.contact.pulls]
        shapes = {contact_frame(limb): [_foot(climber, limb)] for limb in feet}
        spec = mujoco_spec(robot, time_step=TIME_STEP, contacts=shapes, drawn=False)
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, FRICTION_STIFFNESS
        frictions = {f"{contact_frame(limb)} 0": getattr(limb.contact, "friction", 0.0) for limb in feet}
        for geom in spec.geoms:
            if geom.name in frictions:
                geom.friction[0], geom.condim = errors.friction * frictions[geom.name], 3
                geom.solref = [CONTACT_TIME, 1.0]
        for name, placed in scene.bodies.items() if feet else ():
            geom, shape = spec.worldbody.add_geom(), placed.shape
            geom.pos, geom.quat = placed.placement.translation, np.roll(pin.SE3ToXYZQUAT(placed.placement)[3:], 1)
            if isinstance(shape, HalfSpace):
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0]
            elif isinstance(shape, EndlessCylinder):
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_CYLINDER, [shape.radius, ENDLESS, 0.0]
            elif isinstance(shape, Solid):
                shape.become(geom, spec, name)
            else:
                raise ShapeError(f"scene.bodies, {name}", type(shape).__name__, "MuJoCo has no such shape")
            # Of two time constants the mean counts
            geom.name, geom.solref = f"scene {name}", [CONTACT_TIME, 1.0]
            # Of two frictions the larger one counts: that of the foot
            geom.contype, geom.conaffinity, geom.friction[0] = TOUCHED, TOUCHING, 0.0
        grips = [contact_frame(limb) for limb in climber.limbs if limb.contact.pulls]
        super().__init__(robot, grips, motors=errors.motors, seed=errors.seed, spec=spec)
        self._touching = [self._model.geom(name).id if name in frictions else -1
                          for name in (f"{contact_frame(limb)} 0" for limb in climber.limbs)]  # fmt: skip

    def reset(self, q: Array, time: float, v: Array | None = None) -> None:
        """As of :class:`GrippingMujocoPlant`; no fault has come yet."""
        self._events.reset()
        super().reset(q, time, v)

    def advance(self, dt: float) -> None:
        """As of :class:`GrippingMujocoPlant`, with the faults whose time has come."""
        self._events.happen(self, float(self.data.time))
        super().advance(dt)

    @property
    def contact_torques(self) -> Array:
        """J'w of grips and contacts in the last time step ``[nv]`` [N; N m]."""
        return np.asarray(self._joints.v(self.data.qpos, self.data.qfrc_constraint))

    def contact_forces(self) -> Array:
        """By MuJoCo's contacts: of each limb (normal force, friction's size) ``[limbs, 2]`` [N]; 0 of grips."""
        import mujoco

        out, force = np.zeros((len(self._touching), 2)), np.zeros(6)
        for k in range(int(self.data.ncon)):
            contact = self.data.contact[k]
            for limb, geom in enumerate(self._touching):
                if geom in (contact.geom1, contact.geom2) and geom >= 0:
                    mujoco.mj_contactForce(self._model, self.data, k, force)
                    out[limb] += force[0], float(np.hypot(force[1], force[2]))
        return out


def _foot(climber: Climber, limb: ClimbLimb) -> PlacedShape:
    """What touches, in the contact frame: of a ball itself; else its lowest point is the frame's origin at rest."""
    if isinstance(limb.contact, FlatFoot):
        x, y = limb.contact.half_lengths
        sole = pin.SE3(np.eye(3), np.array([0.0, 0.0, SOLE_THICKNESS / 2]))
        return PlacedShape(Box((2 * x, 2 * y, SOLE_THICKNESS)), sole)
    if radius := limb.contact.height:
        return PlacedShape(Sphere(radius), pin.SE3.Identity())
    turn = climber.contact_pose(climber.rest, climber.row(limb.name)).rotation
    return PlacedShape(Sphere(BALL), pin.SE3(np.eye(3), BALL * turn[2]))
