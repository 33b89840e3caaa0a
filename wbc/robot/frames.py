"""One name, one frame: files may give a joint the name of its link, and a frame is looked up by name alone."""

from __future__ import annotations

from collections import Counter

from wbc.multibody import own


def make_frames_unique(model: own.Model) -> dict[str, str]:
    """Renames frames that share a name, in place: the link keeps it, a joint's frame gets ``_joint`` appended.

    Returns:
        Old name -> new name.
    """
    count = Counter(str(frame.name) for frame in model.frames)
    bodies = {str(frame.name) for frame in model.frames if frame.type == own.FrameType.BODY}
    taken, renamed = set(count), {}
    for index, frame in enumerate(model.frames):
        name = str(frame.name)
        if count[name] < 2 or frame.type == own.FrameType.BODY:
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
    return renamed
