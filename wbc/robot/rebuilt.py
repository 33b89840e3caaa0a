"""A model on another base or without some of its joints, with everything that a ``pin.Model`` says kept, frames in
their order.

Pinocchio 4.1 loses part of it: ``appendModel`` sets armatures to 0 and gravity to 9.81 m/s^2 downwards, and drops
reference configurations; ``buildReducedModel`` refuses a model whose ``velocityLimit`` was lowered, as
``lowerVelocityLimit`` keeps the largest speed with a positive sign; both fail where a link and a joint share a name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wbc.multibody import algebra, own, pin, single_joint
from wbc.multibody.model import OF_COORDINATES, OF_DOFS
from wbc.symbolic.joints import follower_of
from wbc.validation import Array


def on_joint(model: pin.Model, joint: pin.JointModel, name: str) -> pin.Model:
    """The model with its world on a joint; reference configurations have that joint in its neutral one."""
    library = algebra(model)
    root = library.Model()
    root.addJointFrame(root.addJoint(0, joint, library.SE3.Identity(), name))
    return _appended(root, model, library.neutral(model), ())


def without_joints(model: pin.Model, joints: Sequence[int], q: Array) -> pin.Model:
    """The model with some joints locked where a configuration has them."""
    return _appended(algebra(model).Model(), model, q, joints)


def _appended(out: pin.Model, model: pin.Model, q: Array, locked: Sequence[int]) -> pin.Model:
    """``out`` with the joints, bodies and frames of a model after its own, the model's world on its last joint."""
    library = algebra(model)
    data, start, base, first = model.createData(), library.neutral(out), int(out.njoints) - 1, len(out.frames) - 1
    library.forwardKinematics(model, data, q)
    # Of each joint of the model: the joint that carries its body, and the body's pose there
    carriers = [(base, library.SE3.Identity())]
    leaders = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))
    coupled = list[tuple[int, int, float, float]]()
    for j in range(1, model.njoints):
        joint, pose = carriers[model.parents[j]]
        if j in locked:
            carriers.append((joint, pose * data.liMi[j]))
            continue
        name, placement = str(model.names[j]), pose * model.jointPlacements[j]
        made = model.joints[j]
        if j in model.mimicking_joints:
            turns, axis, ratio, offset = follower_of(made, int(model.nqs[leaders[j]]), name)
            made = single_joint(axis, slides=not turns, library=library)
            coupled.append((carriers[leaders[j]][0], int(out.njoints), ratio, offset))
        carriers.append((out.addJoint(joint, made, placement, name), library.SE3.Identity()))
    for (joint, pose), inertia in zip(carriers, model.inertias, strict=True):
        out.appendBodyToJoint(joint, inertia, pose)
    numbers = {0: first}
    for k, frame in enumerate(model.frames):
        if k > 0:
            joint, pose = carriers[frame.parentJoint]
            name, kind = str(frame.name), frame.type
            if kind == library.FrameType.JOINT and frame.parentJoint in locked:
                kind = library.FrameType.FIXED_JOINT
                while out.existFrame(name, kind):
                    name += "_"
            above = numbers[int(frame.parentFrame)]
            added = library.Frame(name, joint, above, pose * frame.placement, kind, frame.inertia)
            numbers[k] = out.addFrame(added, False)
    for pair in coupled:
        out = library.transformJointIntoMimic(out, *pair)
    out.name, out.gravity = str(model.name), library.Motion(model.gravity)
    kept = [j for j in range(1, model.njoints) if j not in locked]
    for names, starts, sizes, before in (
        (OF_COORDINATES, model.idx_qs, model.nqs, len(start)),
        (OF_DOFS, model.idx_vs, model.nvs, int(sum(out.nvs[: base + 1]))),
    ):
        for key in names:
            source = np.array(getattr(model, key))
            parts = (source[starts[j] : starts[j] + sizes[j]] for j in kept)
            setattr(out, key, np.concatenate([np.array(getattr(out, key))[:before], *parts]))
    for key, values in _references(model).items():
        parts = (values[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] for j in kept)
        out.referenceConfigurations[key] = np.concatenate([start, *parts])
    return out


def _references(model: pin.Model) -> dict[str, Array]:
    if isinstance(model, own.Model):
        return dict(model.referenceConfigurations)
    return {entry.key(): np.array(entry.data()) for entry in model.referenceConfigurations}
