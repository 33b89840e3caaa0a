"""A clip from a file of any format, with z up, in metres, without gaps and swapped markers."""

from __future__ import annotations

import os
import pathlib
from dataclasses import replace

import numpy as np

from wbc import validation
from wbc.errors import RangeError, UnknownNameError
from wbc.retarget.clip import Array, Clip, Skeleton, listed, nearest_above
from wbc.retarget.sources import arrays
from wbc.retarget.sources.axes import TO_Z_UP, UNITS, FileAxes
from wbc.retarget.sources.bvh import read_bvh
from wbc.retarget.sources.c3d import read_c3d
from wbc.retarget.sources.keypoints import Names, of_points, read_csv, read_npz
from wbc.retarget.sources.markers import joined
from wbc.retarget.sources.mending import fill_gaps, mend_swaps
from wbc.retarget.sources.recorded import Recorded, no_clip
from wbc.retarget.sources.smpl import has_poses, read_smpl

#: Suffixes of files that are read
CLIP_SUFFIXES = (".bvh", ".c3d", ".npz", ".npy", ".csv", ".pkl", ".pt")
#: Suffixes of clips that other programs convert
CONVERTED = (".fbx", ".glb", ".gltf", ".trc", ".asf", ".amc")
#: Least frames a second [Hz]
SLOWEST = 10.0
#: Most frames a second [Hz]
FASTEST = 1000.0
#: A rate this near to a whole number is that number, as a share: files round the time of a frame
WHOLE = 2e-3
#: What lies this far below the ground is raised onto it [m]
BELOW = 0.15


def load_clip(
    path: str | os.PathLike[str],
    *,
    body_model: str | os.PathLike[str] | None = None,
    names: Names = None,
    rate: float | None = None,
    up: str | None = None,
    unit: str | float | None = None,
) -> Clip:
    """A clip from a file: BVH, C3D, AMASS and SMPL (npz, pkl), key points (npy, npz, csv, pt).

    What the file does not say is found from the motion, what is wrong in it is mended, and both are in the clip's
    notes: the unit, the axis that is up, left-handed axes, gaps, swapped markers.

        clip = wbc.retarget.load_clip("walk.bvh")
        clip.notes      # ('y is up in the file', 'its unit is centimetres: the body is 171 of them')

    Args:
        body_model: file of SMPL, SMPL-H or SMPL-X (npz or pkl), for clips that have rotations alone.
        names: of the joints of an array without names, or of a layout such as ``"smplx"`` or ``"lafan"``.
        rate: frames a second where the file does not say [Hz], from 10 to 1000; it overrules the file.
        up: axis of the file that is up, ``"x"`` to ``"-z"``; default: found.
        unit: of the file, ``"m"``, ``"cm"``, ``"mm"``, ``"in"``, ``"ft"``, or its length [m]; default: found.

    Raises:
        ClipFileError: there is no such file, it is broken, empty, or of another format; the text says what to do.
        RangeError: no rate, or one beyond the bounds; a body's size that fits no unit. UnknownNameError: no such axis,
        unit or layout. ShapeError: another number of names. MissingPackageError: C3D without ezc3d.
    """
    file = validation.file_path("clip", path)
    recorded = _read(file, body_model, names)
    recorded.rate = _rate(rate, recorded)
    return _finished(recorded, file.stem, up, unit)


def _read(file: pathlib.Path, body_model: str | os.PathLike[str] | None, names: Names) -> Recorded:
    kind = file.suffix.lower()
    if kind in CONVERTED:
        raise no_clip(file, f"{kind} is not read: convert it to BVH, in Blender by File > Import, then File > Export")
    if kind not in CLIP_SUFFIXES:
        raise UnknownNameError("clip", file.suffix or str(file), CLIP_SUFFIXES)
    if not validation.is_file("clip", file):
        raise no_clip(file, validation.no_such(file))
    if kind == ".csv":
        return read_csv(file, names)
    if kind in (".bvh", ".c3d"):
        recorded = read_bvh(file) if kind == ".bvh" else read_c3d(file)
        recorded.notes += [] if names is None else ["names= is for files without names, and is left out"]
        return recorded
    data = arrays.load(file)
    if kind == ".pkl" or has_poses(data):
        return read_smpl(file, data, None if body_model is None else validation.file_path("body_model", body_model))
    return read_npz(file, data, names) if isinstance(data, dict) else of_points(file, data, names)


def _rate(given: float | None, recorded: Recorded) -> float:
    """Frames a second."""
    if given is None and not recorded.rate > 0.0:
        raise RangeError("rate", recorded.rate, "the file says no frames a second; give rate= [Hz]")
    rate = recorded.rate if given is None else validation.scalar("rate", given, low=0.0, open_low=True, unit="Hz")
    near = round(rate)
    rate = float(near) if near > 0 and abs(rate - near) < WHOLE * rate else rate
    if not SLOWEST <= rate <= FASTEST:
        asked = "" if given is not None else "; give rate= where the file is wrong"
        raise RangeError("rate", rate, f"expected {SLOWEST:g} to {FASTEST:g} frames a second{asked}")
    if given is not None and recorded.rate > 0.0 and abs(recorded.rate - rate) > WHOLE * rate:
        recorded.notes.append(f"the file says {recorded.rate:.6g} frames a second")
    return rate


def _finished(recorded: Recorded, name: str, up: str | None, unit: str | float | None) -> Clip:
    """The clip with z up, in metres, with all points."""
    _without_unseen(recorded, name)
    notes, names, parents, rate, turns = (getattr(recorded, k) for k in ("notes", "names", "parents", "rate", "turns"))
    # Axes and units are looked for in points without gaps
    axes = FileAxes(replace(recorded, points=fill_gaps(recorded.points, parents, names, rate)))
    up = axes.find_up() if up is None else validation.one_of("up", up, TO_Z_UP)
    length, to_world, mirror = _unit(axes, up, unit), TO_Z_UP[up], np.eye(3)
    if axes.is_mirrored(up):
        mirror = np.diag([1.0, -1.0, 1.0])
        notes.append("the file has left-handed axes: left and right are put right")
    points = recorded.points @ (mirror @ to_world).T * length
    if turns is None:
        points = mend_swaps(points, names, rate, notes)
    seen = recorded.seen if recorded.seen is not None else np.asarray(np.isfinite(points).all(axis=2))
    points = fill_gaps(points, parents, names, rate, notes)
    lowest = float(np.percentile(points[:, :, 2].min(axis=1), 5.0))
    if lowest < -BELOW:
        # As of a root that is the origin
        notes.append(f"raised by {-lowest:.3g} m: its lowest points were below z = 0")
        points = points - np.array([0.0, 0.0, lowest])
    if turns is None and parents.count(-1) > 1 and (made := joined(names, points, seen)) is not None:
        names, parents, points, seen = made
        notes.append("hips, knees and all other joints are in the middle of markers of theirs")
    if recorded.offsets is None or turns is None:
        offsets = _offsets(points, parents)
    else:
        of_rest = mirror @ TO_Z_UP[axes.rest_up or up]
        offsets = recorded.offsets @ of_rest.T * length
        turns = mirror @ to_world @ turns @ of_rest.T
    ends = tuple(recorded.ends) or (False,) * len(names)
    return Clip(Skeleton(tuple(names), tuple(parents), offsets, ends), rate, points, turns, seen, name, tuple(notes))


def _unit(axes: FileAxes, up: str, given: str | float | None) -> float:
    """Length of the file's unit [m]."""
    if isinstance(given, str):
        return UNITS[validation.one_of("unit", given, UNITS)][0]
    return axes.find_unit(up) if given is None else validation.scalar("unit", given, low=1e-6, high=1e3, unit="m")


def _without_unseen(recorded: Recorded, name: str) -> None:
    """Take out joints without a point in any frame; their children hang from their parents."""
    there = np.asarray(np.isfinite(recorded.points).all(axis=2).any(axis=0))
    kept = np.flatnonzero(there).tolist()
    if not kept:
        raise no_clip(name, "no point in any frame")
    if gone := [recorded.names[joint] for joint in np.flatnonzero(~there)]:
        above = [nearest_above(recorded.parents, joint, kept) for joint in kept]
        recorded.parents = [kept.index(joint) if joint >= 0 else -1 for joint in above]
        recorded.names, recorded.points = [recorded.names[joint] for joint in kept], recorded.points[:, kept]
        recorded.notes.append(f"never seen, and left out: {listed(gone)}")


def _offsets(points: Array, parents: list[int]) -> Array:
    """Offsets of a skeleton whose file has none: bones of median lengths, as in the frame in which it is tallest."""
    tallest, above = int(np.argmax(np.ptp(points[:, :, 2], axis=1))), np.array(parents)[:, None]
    bones = np.where(above < 0, points, points - points[:, parents])
    sizes = np.linalg.norm(bones, axis=2, keepdims=True)
    ratios = np.where(above < 0, 1.0, np.median(sizes, axis=0) / np.maximum(sizes[tallest], 1e-12))
    return np.asarray(bones[tallest] * ratios)
