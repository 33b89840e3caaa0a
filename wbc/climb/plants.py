"""A climber and its scene in MuJoCo, with what the loop does not know of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wbc import extras, validation
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import FlatFoot
from wbc.climb.loop.stack import contact_frame, contact_robot
from wbc.climb.scene import ClimbScene
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.shapes import Box, HalfSpace, PlacedShape, Solid, Sphere
from wbc.simulation import GrippingMujocoPlant, Motors, mujoco_spec
from wbc.validation import Array

#: Radius of the ball at a point foot: its point of contact wanders by as much as it rolls [m]
BALL = 0.002
#: Thickness of a sole [m]
SOLE_THICKNESS = 0.01
#: Time constant of contacts, four time steps of 1 ms [s]
CONTACT_TIME = 0.004
#: Ratio of the stiffness of friction to that of normal forces: feet creep less [1]
FRICTION_STIFFNESS = 10.0
#: Bit of what stands in the world, as of :func:`mujoco_spec`
TOUCHED = 1
#: Bit of what touches it
TOUCHING = 2


@dataclass(frozen=True)
class PlantErrors:
    """How a plant differs from what plan and loop count on.

    Attributes:
        friction: part of the limbs' friction that there is.
        mass: largest relative error of each link's mass and inertia, drawn evenly.
        delay: of the torques [s].
        seed: of the draw.
    """

    friction: float = 1.0
    mass: float = 0.0
    delay: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        validation.scalar("PlantErrors.friction", self.friction, low=0.0)
        validation.scalar("PlantErrors.mass", self.mass, low=0.0, high=0.9)
        validation.scalar("PlantErrors.delay", self.delay, low=0.0, unit="s")


class ClimbPlant(GrippingMujocoPlant):
    """Feet touch the scene's bodies, with the friction of their limbs; limbs that pull are grips.

    A point foot is a ball of 2 mm, a flat foot a box; no other part of the robot touches anything.

    Args:
        climber: what climbs. scene: what it climbs, its gravity too. errors: None: none. time_step: [s].

    Raises:
        MissingPackageError: MuJoCo is not installed. ShapeError: a body that MuJoCo has no shape for. What
        :func:`mujoco_spec` raises.
    """

    def __init__(
        self, climber: Climber, scene: ClimbScene, errors: PlantErrors | None = None, time_step: float = 0.001
    ) -> None:
        extras.require("mujoco", "a climb in MuJoCo")
        import mujoco

        errors = errors or PlantErrors()
        robot = contact_robot(climber, scene.gravity)
        feet = [limb for limb in climber.limbs if not limb.contact.pulls]
        shapes = {contact_frame(limb): [_foot(climber, limb)] for limb in feet}
        spec = mujoco_spec(robot, time_step=time_step, contacts=shapes, drawn=False)
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, FRICTION_STIFFNESS
        drawn = np.random.default_rng(errors.seed)
        for body in spec.bodies[1:]:
            factor = 1.0 + errors.mass * drawn.uniform(-1.0, 1.0)
            body.mass, body.fullinertia = body.mass * factor, np.array(body.fullinertia) * factor
        frictions = {f"{contact_frame(limb)} 0": getattr(limb.contact, "friction", 0.0) for limb in feet}
        for geom in spec.geoms:
            if geom.name in frictions:
                geom.friction[0], geom.condim = errors.friction * frictions[geom.name], 3
                geom.solref = [CONTACT_TIME, 1.0]
        for name, placed in scene.bodies.items():
            geom, shape = spec.worldbody.add_geom(), placed.shape
            geom.pos, geom.quat = placed.placement.translation, np.roll(pin.SE3ToXYZQUAT(placed.placement)[3:], 1)
            if isinstance(shape, HalfSpace):
                geom.type, geom.size = mujoco.mjtGeom.mjGEOM_PLANE, [0.0, 0.0, 1.0]
            elif isinstance(shape, Solid):
                shape.become(geom, spec, name)
            else:
                raise ShapeError(f"scene.bodies, {name}", type(shape).__name__, "MuJoCo has no such shape")
            geom.name = f"scene {name}"
            # Of two frictions the larger one counts: that of the foot
            geom.contype, geom.conaffinity, geom.friction[0] = TOUCHED, TOUCHING, 0.0
        grips = [contact_frame(limb) for limb in climber.limbs if limb.contact.pulls]
        super().__init__(robot, grips, motors=Motors(delay=errors.delay), seed=errors.seed, spec=spec)
        self._touching = [self._model.geom(name).id if name in frictions else -1
                          for name in (f"{contact_frame(limb)} 0" for limb in climber.limbs)]  # fmt: skip

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
    """What touches, in the contact frame: its lowest point is the frame's origin, as the robot stands at rest."""
    if isinstance(limb.contact, FlatFoot):
        x, y = limb.contact.half_lengths
        sole = pin.SE3(np.eye(3), np.array([0.0, 0.0, SOLE_THICKNESS / 2]))
        return PlacedShape(Box((2 * x, 2 * y, SOLE_THICKNESS)), sole)
    turn = climber.contact_pose(climber.rest, climber.row(limb.name)).rotation
    return PlacedShape(Sphere(BALL), pin.SE3(np.eye(3), BALL * turn[2]))
