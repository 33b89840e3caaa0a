"""A run's folder: what was asked for is there from the beginning, so that the run can be checked and gone on with."""

from __future__ import annotations

import json
import pathlib
from dataclasses import replace

import numpy as np

import wbc.log
from wbc import validation
from wbc.climb.request import KEYBOARD, ClimbRequest, DriveRequest, EarlierRun, PathRequest, request_of
from wbc.climb.scene_files import read_scene, save_scene
from wbc.errors import RangeError
from wbc.log import LogFileError

#: What was asked for, in a run's folder
REQUEST = "request.json"
#: The scene of a run, where that was read from a file
SCENE = "scene.csv"
#: A log while it is written
PART = "log.part"


def begin_folder(folder: pathlib.Path, request: ClimbRequest) -> None:
    """Make a folder and write what it needs to be checked and gone on with, however the run ends. Files that a request
    names are named in full; that of a scene is copied.

    Raises:
        LogFileError: it cannot be written.
    """
    mode, scene = request.mode, pathlib.Path(request.scene.scene)
    if isinstance(mode, PathRequest) and mode.plan:
        mode = replace(mode, plan=str(pathlib.Path(mode.plan).absolute()))
    elif isinstance(mode, DriveRequest) and mode.commands not in ("", KEYBOARD):
        mode = replace(mode, commands=str(pathlib.Path(mode.commands).absolute()))
    robot = request.climber.robot
    climber = replace(
        request.climber, robot=str(pathlib.Path(robot).absolute()) if pathlib.Path(robot).suffix else robot
    )
    text = json.dumps(replace(request, mode=mode, climber=climber).plain(), indent=1) + "\n"
    with validation.writing("out", folder, LogFileError):
        folder.mkdir(parents=True, exist_ok=True)
        if scene.suffix:
            save_scene(read_scene(scene, request.scene.gravity), folder / SCENE)
        with validation.replacing("out", folder / REQUEST, LogFileError) as fresh:
            fresh.write_bytes(text.encode())


def read_folder(folder: pathlib.Path) -> ClimbRequest:
    """What the run in a folder was asked to do, its scene that of the folder.

    Raises:
        LogFileError: there is no run.
    """
    try:
        request = request_of(json.loads((folder / REQUEST).read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise LogFileError("run", str(folder), f"there is no climb in this folder: no {REQUEST}") from error
    if pathlib.Path(request.scene.scene).suffix:
        return replace(request, scene=replace(request.scene, scene=str(folder / SCENE)))
    return request


def resumed(folder: str | pathlib.Path, at: float | None = None, points: tuple[str, ...] = ()) -> ClimbRequest:
    """The request that goes on with the run in a folder from where it was at ``at`` [s], to its end or to other points;
    of a run that was ended before its first ticks were written, to do it again.

    Args:
        folder: of the run, ended or killed. at: None: the end of its log. points: None: those of the run.

    Raises:
        LogFileError: there is no run. RangeError: an instant of a run without a log, or a run that went to no place.
    """
    place = pathlib.Path(folder)
    request = read_folder(place)
    mode = request.mode
    if points:
        kept = mode if isinstance(mode, PathRequest) else PathRequest(start=mode.start)
        request = replace(request, mode=replace(kept, points=points, plan=""))
    try:
        t = wbc.log.load(place)["t"]
    except LogFileError:
        t = np.zeros(0)
    if len(t) < 2:
        if at is not None:
            raise RangeError("at", at, "the run was ended before it moved, and can only be begun again")
        return request
    if not isinstance(request.mode, PathRequest):
        raise RangeError("to", points, "the run went to no place; say where to go")
    passed = 0.0 if request.earlier is None else request.earlier.passed + request.earlier.at
    when = float(t[-1]) if at is None else validation.scalar("at", at, low=float(t[0]), high=float(t[-1]), unit="s")
    mode = replace(request.mode, plan="")
    return replace(request, mode=mode, earlier=EarlierRun(str(place.absolute()), when, passed))
