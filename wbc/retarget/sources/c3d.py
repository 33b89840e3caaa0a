"""C3D files of optical motion capture: markers with labels."""

from __future__ import annotations

import itertools
import pathlib
import struct
from typing import Any

import numpy as np

from wbc import extras
from wbc.retarget.sources.keypoints import of_points
from wbc.retarget.sources.recorded import Recorded, no_clip

#: The first bytes of a C3D file: any block of parameters, and 80 in the second byte
KEY = 0x50
#: The header's number of the last frame where there are more than it can hold
MOST = 0xFFFF
#: Size of a block, in which files are padded [bytes]
BLOCK = 512


def read_c3d(path: pathlib.Path) -> Recorded:
    """Markers of a C3D file, by the package ezc3d; :class:`ClipFileError` of a file that is none or has no markers."""
    extras.require("clips", "a C3D file", "ezc3d")
    import ezc3d

    start, size = path.read_bytes()[:24], path.stat().st_size
    if len(start) < 24 or start[1] != KEY or size < 1024:
        raise no_clip(path, "no C3D file, or it is cut off")
    try:
        data = ezc3d.c3d(str(path))
        about: Any = data["parameters"]["POINT"]
        points = np.moveaxis(np.asarray(data["data"]["points"], dtype=float)[:3], 0, 2).swapaxes(0, 1)
        # A parameter holds 255 labels: LABELS2 goes on where it ends
        more = itertools.takewhile(lambda key: key in about, (f"LABELS{k}" for k in itertools.count(2)))
        labels = [label.strip() for key in ("LABELS", *more) for label in about[key]["value"]]
        rate = float(np.ravel(about["RATE"]["value"])[0])
    except (OSError, RuntimeError, ValueError, KeyError, IndexError, MemoryError) as error:
        raise no_clip(path, f"no C3D file that can be read, or it is cut off: {error}") from error
    names = [labels[k] if k < len(labels) and labels[k] else f"marker{k + 1}" for k in range(points.shape[1])]
    # A marker that is lost is NaN, or all zeros where the software wrote no residual
    clip = of_points(path, np.where((points == 0.0).all(axis=2, keepdims=True), np.nan, points), names)
    clip.rate = rate
    # ezc3d counts the frames that are there; the header has the numbers of the first and last one
    used, analog, first, last, _, scale, block = struct.unpack("<HHHHHfH", start[2:18])
    frames = len(points)
    if last < MOST and frames < last - first + 1:
        clip.notes.append(f"the file is cut off: it has {frames} of {last - first + 1} frames")
    room = (size - BLOCK * block) // max(1, (4 * used + analog) * (4 if scale < 0.0 else 2))
    if last == MOST and room > frames:
        clip.notes.append(
            f"the file has some {room} frames, of which ezc3d reads {frames}: the rest is not in the clip"
        )
    return clip
