"""Contact plans as files: written and read exactly, and what two of them do differently."""

from __future__ import annotations

import json
import os
import pathlib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.loop.records import bodies_digest
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.validation import Array

#: Name of a plan in a run's folder
PLAN = "plan.npz"
#: Of the files that are written here
FORMAT = 1
#: How far a foothold may be from where it was planned [m, or a part of an axis]: rounding
SAME_PLACE = 1e-9


class PlanFileError(WbcError):
    """A file of a contact plan that is missing, cannot be read, or is of another robot or scene."""


@dataclass(frozen=True, eq=False)
class PlanRecord:
    """A plan by names.

    Attributes:
        about: names and digests of robot and scene, and the plan's margin.
        limbs: names. footholds: ids of those that it uses, and poses: where they are ``(n, 7)`` [m], quaternions.
        start: rows of ``footholds``, one a limb; -1 where it holds none.
        moves: (limb, leaves, lands) by rows ``(m, 3)``. spans: (lift, land) of each ``(m, 2)`` [s].
        times, q, v: as of :class:`ContactPlan`.
    """

    about: dict[str, Any]
    limbs: tuple[str, ...]
    footholds: tuple[str, ...]
    poses: Array
    start: NDArray[np.int64]
    moves: NDArray[np.int64]
    spans: Array
    times: Array
    q: Array
    v: Array

    def held(self, row: int) -> str:
        """The id in a row, "nothing" for -1."""
        return self.footholds[row] if row >= 0 else "nothing"


#: Arrays of a file, and how many dimensions each has
_ARRAYS = {"poses": 2, "start": 1, "moves": 2, "spans": 2, "times": 1, "q": 2, "v": 2}


def record_of(plan: ContactPlan) -> PlanRecord:
    """A plan by names of limbs and footholds."""
    climber, scene = plan.climber, plan.scene
    used = sorted({*plan.start, *(row for move in plan.moves for row in (move.leaves, move.lands))} - {FREE_LIMB})
    rows = {row: k for k, row in enumerate(used)} | {FREE_LIMB: FREE_LIMB}
    about = {
        "format": FORMAT, "climber": climber.name, "robot": climber.robot.name,
        "robot_digest": climber.robot.fingerprint, "scene": scene.name, "bodies_digest": bodies_digest(scene),
        "margin": plan.margin,
    }  # fmt: skip
    return PlanRecord(
        about,
        tuple(limb.name for limb in climber.limbs),
        tuple(scene.footholds[row].id for row in used),
        np.array([pin.SE3ToXYZQUAT(scene.footholds[row].pose) for row in used]).reshape(-1, 7),
        np.array([rows[row] for row in plan.start], dtype=np.int64),
        np.array([(m.limb, rows[m.leaves], rows[m.lands]) for m in plan.moves], dtype=np.int64).reshape(-1, 3),
        np.array([(m.lift, m.land) for m in plan.moves], dtype=float).reshape(-1, 2),
        np.array(plan.times, dtype=float),
        np.array(plan.q, dtype=float),
        np.array(plan.v, dtype=float),
    )


def save_plan(plan: ContactPlan, path: str | os.PathLike[str]) -> pathlib.Path:
    """Write a plan as npz, whole or not at all; returns the file.

    Raises:
        ShapeError: no plan. PlanFileError: it cannot be written.
    """
    record = record_of(validation.instance("plan", plan, ContactPlan, "a ContactPlan"))
    file = validation.file_path("path", path)
    said = {**record.about, "limbs": record.limbs, "footholds": record.footholds}
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    with validation.replacing("plan", file, PlanFileError) as fresh, fresh.open("wb") as stream:
        np.savez_compressed(stream, allow_pickle=False, about=np.array(json.dumps(said)), **arrays)
    return file


def read_record(path: str | os.PathLike[str]) -> PlanRecord:
    """What :func:`save_plan` wrote, or what a run's folder has of it.

    Raises:
        PlanFileError: no such file, or no plan.
    """
    file = validation.file_path("plan", path)
    file = file / PLAN if file.is_dir() else file
    if not validation.exists("plan", file):
        raise PlanFileError("plan", str(file), validation.no_such(file))
    try:
        with np.load(file, allow_pickle=False) as data:
            about = json.loads(str(data["about"]))
            arrays = {name: np.array(data[name]) for name in _ARRAYS}
        limbs, footholds = tuple(about.pop("limbs")), tuple(about.pop("footholds"))
        for name, dimensions in _ARRAYS.items():
            if arrays[name].ndim != dimensions or not np.isfinite(arrays[name]).all():
                raise ValueError(f"{name} is no array of {dimensions} dimensions of finite numbers")
        rows = np.r_[arrays["start"], arrays["moves"][:, 1:].ravel()]
        if about["format"] != FORMAT:
            raise ValueError(f"of format {about['format']}, expected {FORMAT}")
        if rows.min() < FREE_LIMB or rows.max() >= len(footholds) or len(arrays["start"]) != len(limbs):
            raise ValueError("rows of footholds that are not there")
        return PlanRecord(about, limbs, footholds, **arrays)
    except (OSError, KeyError, ValueError, TypeError, IndexError, EOFError, zipfile.BadZipFile) as error:
        raise PlanFileError("plan", str(file), f"no contact plan: {error}") from error


def read_plan(path: str | os.PathLike[str], climber: Climber, scene: ClimbScene) -> ContactPlan:
    """The plan in a file, for the robot and on the footholds and among the bodies that it was made for; footholds that
    it does not use may be others.

        save_plan(plan, "plan.npz")
        read_plan("plan.npz", climber, scene)

    Raises:
        PlanFileError: no such file, no plan, or one of another robot or scene: what differs is named.
        UnknownNameError: a foothold is not there.
    """
    record = read_record(path)
    about, names = record.about, tuple(limb.name for limb in climber.limbs)
    for field, was, now in (
        ("robot", about.get("robot_digest"), climber.robot.fingerprint),
        ("limbs", record.limbs, names),
        ("scene", about.get("bodies_digest"), bodies_digest(scene)),
    ):
        if was != now:
            said = {"robot": about.get("climber"), "limbs": record.limbs, "scene": about.get("scene")}[field]
            what = "bodies or gravity are others" if field == "scene" else f"the {field} is another one"
            raise PlanFileError("plan", str(path), f"it is of {field} {said}; here {what}")
    rows = [scene.row(name) for name in record.footholds]
    for name, row, pose in zip(record.footholds, rows, record.poses, strict=True):
        off = np.abs(pin.XYZQUATToSE3(pose).homogeneous - scene.footholds[row].pose.homogeneous).max()
        if off > SAME_PLACE:
            raise PlanFileError("plan", str(path), f"foothold {name} is {off:.3g} m or more from where it was planned")
    of = dict(enumerate(rows)) | {FREE_LIMB: FREE_LIMB}
    moves = [
        ContactMove(int(limb), of[int(leaves)], of[int(lands)], float(lift), float(land))
        for (limb, leaves, lands), (lift, land) in zip(record.moves, record.spans, strict=True)
    ]
    start = tuple(of[int(row)] for row in record.start)
    return ContactPlan(climber, scene, start, moves, record.times, record.q, record.v, about.get("margin"))


def differences(one: PlanRecord, other: PlanRecord) -> list[str]:
    """What two plans do differently, a line each: where they start, their moves, how long they take, and how far apart
    the motions are.
    """
    if one.limbs != other.limbs:
        return [f"limbs: {', '.join(one.limbs)}, and {', '.join(other.limbs)}"]
    lines = [
        f"start of {limb}: {one.held(a)}, and {other.held(b)}"
        for limb, a, b in zip(one.limbs, one.start, other.start, strict=True)
        if one.held(a) != other.held(b)
    ]
    for k, (a, b) in enumerate(zip_longest(_told(one), _told(other), fillvalue="none"), 1):
        if a != b:
            lines.append(f"move {k}: {a}, and {b}")
    if one.times[-1] != other.times[-1]:
        lines.append(f"duration: {one.times[-1]:.6g} s, and {other.times[-1]:.6g} s")
    same = one.times.shape == other.times.shape and one.q.shape == other.q.shape
    if not lines and not (
        same and all(np.array_equal(getattr(one, n), getattr(other, n)) for n in ("times", "q", "v"))
    ):
        away = f", by up to {np.abs(one.q - other.q).max():.3g} m or rad" if same else ""
        lines.append(f"the motion between the same moves{away}")
    return lines


def _told(record: PlanRecord) -> Sequence[str]:
    return [
        f"{record.limbs[limb]} from {record.held(leaves)} to {record.held(lands)}, {lift:.3f} to {land:.3f} s"
        for (limb, leaves, lands), (lift, land) in zip(record.moves.tolist(), record.spans.tolist(), strict=True)
    ]
