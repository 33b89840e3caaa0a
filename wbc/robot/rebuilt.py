"""A model on another base or without some of its joints, with everything that a ``pin.Model`` says kept.

Pinocchio 4.1 loses part of it: ``appendModel`` sets armatures to 0 and gravity to 9.81 m/s^2 downwards, and drops
reference configurations; ``buildReducedModel`` refuses a model whose ``velocityLimit`` was lowered, as
``lowerVelocityLimit`` keeps the largest speed with a positive sign; both fail where a link and a joint share a name.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.validation import Array

#: Limits by pairs, which Pinocchio compares with each other
_PAIRED = ("DryFrictionLimit", "EffortLimit", "PositionLimit", "VelocityLimit")
#: What labels of joints begin with; no file has such names
_JOINT = "\x01joint "
#: What labels of frames begin with; no file has such names
_FRAME = "\x01frame "
OF_DOFS = (
    "armature",
    "damping",
    "lowerDryFrictionLimit",
    "lowerEffortLimit",
    "lowerVelocityLimit",
    "rotorGearRatio",
    "rotorInertia",
    "upperDryFrictionLimit",
    "upperEffortLimit",
    "upperVelocityLimit",
)
OF_COORDINATES = ("lowerPositionLimit", "positionLimitMargin", "upperPositionLimit")


def on_joint(model: pin.Model, joint: pin.JointModel, name: str) -> pin.Model:
    """The model with its world on a joint; reference configurations have that joint in its neutral one."""
    root = pin.Model()
    while model.existJointName(name):
        name += "_"
    index = root.addJoint(0, joint, pin.SE3.Identity(), name)
    root.addJointFrame(index)
    start = pin.neutral(root)
    out = pin.appendModel(root, _labelled(model), root.getFrameId(name), pin.SE3.Identity())
    _fill(out, model)
    for entry in model.referenceConfigurations:
        out.referenceConfigurations[entry.key()] = np.concatenate([start, np.array(entry.data())])
    return out


def without_joints(model: pin.Model, joints: Sequence[int], q: Array) -> pin.Model:
    """The model with some joints locked where a configuration has them."""
    out = pin.buildReducedModel(_labelled(model), list(joints), q)
    _fill(out, model)
    kept = [there for _, there, _, _ in _shared(out, model)]
    for entry in model.referenceConfigurations:
        parts = (np.array(entry.data())[there] for there in kept)
        out.referenceConfigurations[entry.key()] = np.concatenate([np.zeros(0), *parts])
    return out


def _labelled(model: pin.Model) -> pin.Model:
    """A copy with limits that Pinocchio does not refuse, and a name of its own for every joint and frame."""
    out = pin.Model(model)
    for pair in _PAIRED:
        count = out.nq if pair == "PositionLimit" else out.nv
        setattr(out, f"lower{pair}", np.full(count, -np.inf))
        setattr(out, f"upper{pair}", np.full(count, np.inf))
    for j in range(1, out.njoints):
        out.names[j] = f"{_JOINT}{j}"
    for k, frame in enumerate(out.frames):
        if k > 0:
            # Pinocchio looks for the frame of a joint by the joint's name
            own = frame.type == pin.FrameType.JOINT and model.frames[k].name == model.names[frame.parentJoint]
            frame.name = f"{_JOINT}{frame.parentJoint}" if own else f"{_FRAME}{k}"
    return out


def _shared(out: pin.Model, model: pin.Model) -> list[tuple[slice, slice, slice, slice]]:
    """Of each joint of ``out`` that ``model`` has: its coordinates here and there, its degrees of freedom alike."""
    found = []
    for j in range(1, out.njoints):
        if not model.existJointName(str(out.names[j])):
            continue
        k, nq, nv = model.getJointId(str(out.names[j])), int(out.nqs[j]), int(out.nvs[j])
        starts = int(out.idx_qs[j]), int(model.idx_qs[k]), int(out.idx_vs[j]), int(model.idx_vs[k])
        q, p, v, w = (slice(start, start + n) for start, n in zip(starts, (nq, nq, nv, nv), strict=True))
        found.append((q, p, v, w))
    return found


def _fill(out: pin.Model, model: pin.Model) -> None:
    """Gives the labelled joints and frames of ``out`` their names and fields of the model again."""
    for j, label in enumerate(list(out.names)):
        if str(label).startswith(_JOINT):
            out.names[j] = model.names[int(str(label)[len(_JOINT) :])]
    for frame in out.frames:
        label = str(frame.name)
        if label.startswith(_JOINT):
            frame.name = str(model.names[int(label[len(_JOINT) :])])
        elif label.startswith(_FRAME):
            frame.name = str(model.frames[int(label[len(_FRAME) :])].name)
    out.name, out.gravity = str(model.name), pin.Motion(model.gravity)
    shared = _shared(out, model)
    for names, here, there in ((OF_COORDINATES, 0, 1), (OF_DOFS, 2, 3)):
        for name in names:
            values, source = np.array(getattr(out, name)), np.array(getattr(model, name))
            for spans in shared:
                values[spans[here]] = source[spans[there]]
            setattr(out, name, values)
