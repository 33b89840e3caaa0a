"""Random robots by one generator: a value says what may be drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

Array = np.ndarray


def unit(rng: np.random.Generator, count: int = 3) -> Array:
    """A random direction."""
    x = rng.normal(size=count)
    return np.asarray(x / np.linalg.norm(x))


def random_pose(rng: np.random.Generator, far: float = 1.0) -> pin.SE3:
    """A pose with any rotation, about ``far`` away [m]."""
    return pin.SE3(pin.Quaternion(*unit(rng, 4)).matrix(), far * rng.normal(size=3))


def random_inertia(rng: np.random.Generator, mass: tuple[float, float] = (0.8, 4.0), size: float = 1.0) -> pin.Inertia:
    """Of a random cloud of four points about ``size`` apart [m], with a mass within a range [kg]."""
    points, masses = size * rng.normal(size=(4, 3)), rng.uniform(0.2, 1.0, 4)
    masses *= rng.uniform(*mass) / masses.sum()
    center = masses @ points / masses.sum()
    arms = points - center
    about = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, arms, strict=True))
    return pin.Inertia(masses.sum(), center, about)


#: Joints by the name of their kind, about or along a random axis where they have one
KINDS: dict[str, Callable[[np.random.Generator], pin.JointModel]] = {
    "turning": lambda rng: pin.JointModelRevoluteUnaligned(unit(rng)),
    "aligned": lambda rng: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)[rng.integers(3)](),
    "endless": lambda rng: pin.JointModelRUBZ(),
    "sliding": lambda rng: pin.JointModelPrismaticUnaligned(unit(rng)),
}


@dataclass(frozen=True)
class Drawn:
    """What may be drawn of a robot.

    Attributes:
        base: joint of the base, None for the world.
        limbs, joints: how many limbs on the base, and how many joints each of them has, at least and at most.
        kinds: shares of the :data:`KINDS` of joints.
        far: distances from joint to joint, at least and at most [m].
        turned: whether the axes of a joint are turned against those of the one before it.
        mass: of a body, at least and at most [kg].
        reach: largest limit of a joint on either side [rad, m]; the least is a sixth of it. None: no limits.
        speed: limits of the joints' velocities, at least and at most [rad/s, m/s].
    """

    base: type[pin.JointModel] | None = None
    limbs: tuple[int, int] = (1, 1)
    joints: tuple[int, int] = (3, 7)
    kinds: Mapping[str, float] = field(default_factory=lambda: {"turning": 1.0})
    far: tuple[float, float] = (0.1, 0.4)
    turned: bool = False
    mass: tuple[float, float] = (0.5, 4.0)
    reach: float | None = 3.0
    speed: tuple[float, float] = (3.0, 30.0)


def random_model(rng: np.random.Generator, drawn: Drawn) -> pin.Model:
    """Joints "a0", "a1", ... of limb a, links "a0_link", ..., a frame "a_tip" beyond the last joint; likewise b, c ...
    A base is the joint "root" with the link "trunk".
    """
    model, shares = pin.Model(), np.array(list(drawn.kinds.values()))
    kinds = list(drawn.kinds)
    base = 0 if drawn.base is None else model.addJoint(0, drawn.base(), pin.SE3.Identity(), "root")
    if base:
        model.addFrame(pin.Frame("trunk", base, pin.SE3.Identity(), pin.FrameType.OP_FRAME))

    def beyond() -> pin.SE3:
        turn = pin.Quaternion(*unit(rng, 4)).matrix() if drawn.turned else np.eye(3)
        return pin.SE3(turn, rng.uniform(*drawn.far) * unit(rng))

    for limb in "abcdef"[: int(rng.integers(*drawn.limbs, endpoint=True))]:
        joint, place = base, beyond()
        for k in range(int(rng.integers(*drawn.joints, endpoint=True))):
            kind = KINDS[kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))]]
            joint = model.addJoint(joint, kind(rng), place, f"{limb}{k}")
            model.addFrame(pin.Frame(f"{limb}{k}_link", joint, random_pose(rng, 0.1), pin.FrameType.OP_FRAME))
            place = beyond()
        model.addFrame(pin.Frame(f"{limb}_tip", joint, place, pin.FrameType.OP_FRAME))
    for joint in range(1, model.njoints):
        model.appendBodyToJoint(joint, random_inertia(rng, drawn.mass, 0.1), pin.SE3.Identity())
    if drawn.reach is not None:
        nq, nv = (model.nqs[base], model.nvs[base]) if base else (0, 0)
        model.upperPositionLimit[nq:] = rng.uniform(drawn.reach / 6, drawn.reach, model.nq - nq)
        model.lowerPositionLimit[nq:] = -rng.uniform(drawn.reach / 6, drawn.reach, model.nq - nq)
        model.velocityLimit[:] = np.concatenate((np.full(nv, np.inf), rng.uniform(*drawn.speed, model.nv - nv)))
    return model
