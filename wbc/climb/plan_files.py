"""Contact plans as logs in files: written and read exactly, and what two of them do differently."""

from __future__ import annotations

import os
import pathlib
from itertools import zip_longest

import numpy as np

import wbc.log
from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.loop.records import bodies_digest, motion_units
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.errors import WbcError
from wbc.log import Log, LogFileError
from wbc.multibody import pin

#: Name of a plan in a run's folder
PLAN = "plan.npz"
#: Of the files that are written here
FORMAT = 2
#: How far a foothold may be from where it was planned [m, or a part of an axis]: rounding
SAME_PLACE = 1e-9


class PlanFileError(WbcError):
    """A file of a contact plan that is missing, cannot be read, or is of another robot or scene."""


#: Tables of a plan as a log, and how many columns each has; 0: it is a row
_TABLES = {"poses": 7, "start": 0, "moves": 3, "spans": 2}


def record_of(plan: ContactPlan) -> Log:
    """A plan by names of limbs and footholds: a log of its knots, with the tables

    poses    of the footholds that it uses ``(n, 7)`` [m], quaternions
    start    of each limb a row of these, or -1
    moves    limb, and the rows that it leaves and lands on ``(m, 3)``. spans: lift and landing of each ``(m, 2)`` [s]
    """
    climber, scene, robot = plan.climber, plan.scene, plan.climber.robot
    used = sorted({*plan.start, *(row for move in plan.moves for row in (move.leaves, move.lands))} - {FREE_LIMB})
    rows = {row: k for k, row in enumerate(used)} | {FREE_LIMB: FREE_LIMB}
    about = {
        "format": FORMAT, "climber": climber.name, "robot": robot.name, "robot_digest": robot.fingerprint,
        "scene": scene.name, "bodies_digest": bodies_digest(scene), "margin": plan.margin,
        "limbs": [limb.name for limb in climber.limbs], "footholds": [scene.footholds[row].id for row in used],
    }  # fmt: skip
    units = {"t": "s", **motion_units(robot)}
    columns = np.column_stack([plan.times, plan.q, plan.v]).T
    tables = {
        "poses": [pin.SE3ToXYZQUAT(scene.footholds[row].pose) for row in used],
        "start": [rows[row] for row in plan.start],
        "moves": [(m.limb, rows[m.leaves], rows[m.lands]) for m in plan.moves],
        "spans": [(m.lift, m.land) for m in plan.moves],
    }
    shaped = {name: np.array(tables[name], dtype=int if name in ("start", "moves") else float) for name in _TABLES}
    shaped = {name: table.reshape(-1, width) if (width := _TABLES[name]) else table for name, table in shaped.items()}
    return Log(dict(zip(units, columns, strict=True)), units, about, shaped)


def save_plan(plan: ContactPlan, path: str | os.PathLike[str]) -> pathlib.Path:
    """Write a plan as a log of kind npz, whole or not at all; returns the file, which ends in ``.npz``.

    Raises:
        ShapeError: no plan, or no path. LogFileError: it cannot be written.
    """
    record = record_of(validation.instance("plan", plan, ContactPlan, "a ContactPlan"))
    file = validation.file_path("path", path)
    return wbc.log.save(record, file.parent, "npz", file.stem)


def read_record(path: str | os.PathLike[str]) -> Log:
    """What :func:`save_plan` wrote, or what a run's folder has of it.

    Raises:
        PlanFileError: no such file, or no plan.
    """
    file = validation.file_path("plan", path)
    file = file / PLAN if file.is_dir() else file
    if not validation.exists("plan", file):
        raise PlanFileError("plan", str(file), validation.no_such(file))
    try:
        record = wbc.log.load(file)
        about, tables = record.meta, record.tables
        if about["format"] != FORMAT:
            raise ValueError(f"of format {about['format']}, expected {FORMAT}")
        for name, width in _TABLES.items():
            if tables[name].shape[1:] != (width,) * (width > 0):
                raise ValueError(f"{name} is no table of {width} columns")
        if not all(np.isfinite(values).all() for values in (*record.columns.values(), *tables.values())):
            raise ValueError("numbers that are not finite")
        rows = np.r_[tables["start"], tables["moves"][:, 1:].ravel()]
        if (
            rows.min() < FREE_LIMB
            or rows.max() >= len(about["footholds"])
            or len(tables["start"]) != len(about["limbs"])
        ):
            raise ValueError("rows of footholds that are not there")
        return record
    except LogFileError as error:
        raise PlanFileError("plan", str(file), f"no contact plan: {error.reason}") from error
    except (KeyError, ValueError, TypeError, IndexError) as error:
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
    about, tables, names = record.meta, record.tables, [limb.name for limb in climber.limbs]
    for field, was, now in (
        ("robot", about.get("robot_digest"), climber.robot.fingerprint),
        ("limbs", about["limbs"], names),
        ("scene", about.get("bodies_digest"), bodies_digest(scene)),
    ):
        if was != now:
            said = {"robot": about.get("climber"), "limbs": about["limbs"], "scene": about.get("scene")}[field]
            what = "bodies or gravity are others" if field == "scene" else f"the {field} is another one"
            raise PlanFileError("plan", str(path), f"it is of {field} {said}; here {what}")
    rows = [scene.row(name) for name in about["footholds"]]
    for name, row, pose in zip(about["footholds"], rows, tables["poses"], strict=True):
        off = np.abs(pin.XYZQUATToSE3(pose).homogeneous - scene.footholds[row].pose.homogeneous).max()
        if off > SAME_PLACE:
            raise PlanFileError("plan", str(path), f"foothold {name} is {off:.3g} m or more from where it was planned")
    of = dict(enumerate(rows)) | {FREE_LIMB: FREE_LIMB}
    moves = [
        ContactMove(limb, of[leaves], of[lands], lift, land)
        for (limb, leaves, lands), (lift, land) in zip(tables["moves"].tolist(), tables["spans"].tolist(), strict=True)
    ]
    start = tuple(of[row] for row in tables["start"].tolist())
    return ContactPlan(
        climber, scene, start, moves, record["t"], record.array("q"), record.array("v"), about.get("margin")
    )


def differences(one: Log, other: Log) -> list[str]:
    """What two plans do differently, a line each: where they start, their moves, how long they take, and how far apart
    the motions are.
    """
    limbs, others = (record.meta["limbs"] for record in (one, other))
    if limbs != others:
        return [f"limbs: {', '.join(limbs)}, and {', '.join(others)}"]
    starts = [[_held(record, row) for row in record.tables["start"]] for record in (one, other)]
    lines = [f"start of {limb}: {a}, and {b}" for limb, a, b in zip(limbs, *starts, strict=True) if a != b]
    for k, (a, b) in enumerate(zip_longest(_told(one), _told(other), fillvalue="none"), 1):
        if a != b:
            lines.append(f"move {k}: {a}, and {b}")
    if one["t"][-1] != other["t"][-1]:
        lines.append(f"duration: {one['t'][-1]:.6g} s, and {other['t'][-1]:.6g} s")
    if not lines and not all(
        np.array_equal(column, other.columns.get(name, np.zeros(0))) for name, column in one.columns.items()
    ):
        q, r = one.array("q"), other.array("q")
        away = f", by up to {np.abs(q - r).max():.3g} m or rad" if q.shape == r.shape else ""
        lines.append(f"the motion between the same moves{away}")
    return lines


def _held(record: Log, row: int) -> str:
    """The id in a row, "nothing" for -1."""
    return str(record.meta["footholds"][row]) if row >= 0 else "nothing"


def _told(record: Log) -> list[str]:
    limbs, moves, spans = record.meta["limbs"], record.tables["moves"].tolist(), record.tables["spans"].tolist()
    return [
        f"{limbs[limb]} from {_held(record, leaves)} to {_held(record, lands)}, {lift:.3f} to {land:.3f} s"
        for (limb, leaves, lands), (lift, land) in zip(moves, spans, strict=True)
    ]
