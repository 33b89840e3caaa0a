"""Models of Pinocchio as trees of the package's own, and random motions of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from tests.random_robots import Drawn, random_model
from wbc.multibody import own
from wbc.multibody.model import OF_COORDINATES, OF_DOFS


def drawn_model(rng: np.random.Generator) -> pin.Model:
    """All kinds of joints on all bases."""
    base = (None, pin.JointModelFreeFlyer, pin.JointModelPlanar, pin.JointModelSpherical)[rng.integers(4)]
    kinds = {"turning": 1.0, "aligned": 1.0, "endless": 1.0, "sliding": 1.0}
    model = random_model(rng, Drawn(base, limbs=(1, 3), joints=(1, 4), kinds=kinds, turned=True))
    model.armature = rng.uniform(0.0, 0.1, model.nv)
    model.gravity = pin.Motion(rng.normal(size=3), np.zeros(3))
    return model


def own_pose(pose: Any) -> own.SE3:
    return own.SE3(pose.rotation, pose.translation)


def own_inertia(inertia: Any) -> own.Inertia:
    return own.Inertia(inertia.mass, inertia.lever, inertia.inertia)


def own_joint(joint: Any) -> own.JointModel:
    kind = joint.shortname()
    if not kind.endswith("Unaligned"):
        return getattr(own, kind)()
    if "Unbounded" not in kind:
        return getattr(own, kind)(np.array(joint.extract().axis))
    data = joint.createData()
    joint.calc(data, np.append(np.zeros(joint.idx_q), [1.0, 0.0]))
    return getattr(own, kind)(np.asarray(data.S)[3:].reshape(3))


def own_model(model: Any) -> own.Model:
    """The same tree, inertias, frames and limits."""
    out = own.Model()
    for j in range(1, model.njoints):
        place = own_pose(model.jointPlacements[j])
        out.addJoint(model.parents[j], own_joint(model.joints[j]), place, str(model.names[j]))
    out.inertias = [own_inertia(inertia) for inertia in model.inertias]
    for k, frame in enumerate(model.frames):
        if k > 0:
            rest = (frame.parentFrame, own_pose(frame.placement), int(frame.type), own_inertia(frame.inertia))
            out.addFrame(own.Frame(frame.name, frame.parentJoint, *rest), False)
    for key in (*OF_DOFS, *OF_COORDINATES):
        setattr(out, key, np.array(getattr(model, key)))
    out.name, out.gravity = model.name, own.Motion(model.gravity.vector)
    return out
