"""One name, one frame: files may give a joint the name of its link, and a frame is looked up by name alone."""

from __future__ import annotations

from collections import Counter

import pinocchio as pin


def make_frames_unique(model: pin.Model) -> dict[str, str]:
    """Renames frames that share a name, in place: the link keeps it, a joint's frame gets ``_joint`` appended.

    A joint follows its frame's new name, as Pinocchio's reduction of models looks it up by that; give the joints
    of the result their names back with :func:`restore_joint_names`.

    Returns:
        Old name -> new name.
    """
    count = Counter(str(frame.name) for frame in model.frames)
    bodies = {str(frame.name) for frame in model.frames if frame.type == pin.FrameType.BODY}
    taken, renamed = set(count), {}
    for index, frame in enumerate(model.frames):
        name = str(frame.name)
        if count[name] < 2 or frame.type == pin.FrameType.BODY:
            continue
        if name not in bodies and name not in renamed:  # no link of this name: the first of the frames keeps it
            bodies.add(name)
            continue
        new = f"{name}_joint"
        while new in taken:
            new += "_"
        taken.add(new)
        renamed[name] = new
        model.frames[index].name = new
        if frame.type == pin.FrameType.JOINT:
            model.names[frame.parentJoint] = new
    return renamed


def restore_joint_names(model: pin.Model, renamed: dict[str, str]) -> None:
    """Gives the joints that :func:`make_frames_unique` renamed their names back; frames keep the new ones."""
    original = {new: old for old, new in renamed.items()}
    for j in range(1, model.njoints):
        name = str(model.names[j])
        model.names[j] = original.get(name, name)
