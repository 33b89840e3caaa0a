"""C3D files of optical motion capture: markers with labels."""

from __future__ import annotations

import itertools
import pathlib
import struct
from typing import Any

import numpy as np

from wbc import extras
from wbc.retarget.sources.layouts import parents_by_name
from wbc.retarget.sources.recorded import Recorded, no_clip, unlike

#: The first bytes of a C3D file: any block of parameters, and 80 in the second byte
KEY = 0x50
#: The header's number of the last frame where there are more than it can hold
MOST = 0xFFFF
#: Size of a block, in which files are padded [bytes]
BLOCK = 512
#: Units of C3D files [m]
LENGTHS = {"m": 1.0, "meter": 1.0, "meters": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "inch": 0.0254, "ft": 0.3048}


def read_c3d(path: pathlib.Path) -> Recorded:
    """Markers of a C3D file, by the package ezc3d.

    Raises:
        MissingPackageError: ezc3d is not installed. ClipFileError: it is no C3D file, is cut off, or has no markers.
    """
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
        labels = [label for key in ("LABELS", *more) for label in about[key]["value"]]
        units = about["UNITS"]["value"]
        rate = float(np.ravel(about["RATE"]["value"])[0])
    except (OSError, RuntimeError, ValueError, KeyError, IndexError, MemoryError) as error:
        raise no_clip(path, f"no C3D file that can be read, or it is cut off: {error}") from error
    # ezc3d counts the frames that are there; the header has the numbers of the first and last one
    used, analog, first, last, _, scale, block = struct.unpack("<HHHHHfH", start[2:18])
    frames, count = len(points), points.shape[1]
    if count == 0 or frames < 2:
        raise no_clip(path, f"{frames} frames of {count} markers: no clip")
    cut = last < MOST and frames < last - first + 1
    notes = [f"the file is cut off: it has {frames} of {last - first + 1} frames"] if cut else []
    frame = (4 * used + analog) * (4 if scale < 0.0 else 2)
    room = (size - BLOCK * block) // max(1, frame)
    if last == MOST and room > frames:
        notes.append(f"the file has some {room} frames, of which ezc3d reads {frames}: the rest is not in the clip")
    names = [label.strip() for label in labels[:count]]
    names = [name or f"marker{k + 1}" for k, name in enumerate([*names, *[""] * (count - len(names))])]
    names = unlike(names, notes)
    # A marker that is lost is NaN, or all zeros where the software wrote no residual
    points = np.where((points == 0.0).all(axis=2, keepdims=True), np.nan, points)
    unit = LENGTHS.get(units[0].strip().lower(), 0.0) if units else 0.0
    return Recorded(names, parents_by_name(names), points, rate, unit=unit, usual="z", notes=notes)
