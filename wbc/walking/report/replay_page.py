"""A walk as a page for a browser: one file that needs no network, to be turned and played back."""

from __future__ import annotations

import contextlib
import importlib
import io
import itertools
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from wbc import extras
from wbc.rotations import TO_MUJOCO, quaternion
from wbc.shapes import PlacedShape
from wbc.track import render
from wbc.track.scene import simplified
from wbc.validation import Array
from wbc.walking.log.log import WalkLog
from wbc.walking.report import surroundings
from wbc.walking.report.parts import PALE_HAND, Part, part_poses, parts_of
from wbc.walking.report.stills import AZIMUTH, ELEVATION, held_by
from wbc.walking.run.recording import configuration
from wbc.walking.run.session import WalkRun

FILE = "replay.html"
#: Poses a second, and how many there are at most
RATE, MOST = 20.0, 1200
#: Corners of shapes closer than this are one [m]
DETAIL = 0.012
#: Distance of the camera from the middle of the walk [m]
DISTANCE = 5.2
#: Surface below this radius of the body's way is shown [m]
SHOWN = 1.9


def save_replay_page(
    run: WalkRun, log: WalkLog, folder: pathlib.Path, stop: Callable[[], bool] | None = None
) -> pathlib.Path | None:
    """Writes ``replay.html`` with viser; None if ``stop`` ended it.

    Raises:
        MissingPackageError: viser is not installed.
    """
    extras.require("viewer", FILE)
    viser: Any = importlib.import_module("viser")
    # What is recorded is what a server would send; nobody is asked to connect, so its address is not printed
    with contextlib.redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host="127.0.0.1", verbose=False)
        try:
            text = _recorded(server, run, log, stop)
        finally:
            server.stop()
    if text is None:
        return None
    file = folder / FILE
    file.write_text(text.replace("<title>Viser</title>", "<title>walk – wbc replay</title>", 1))
    return file


def _recorded(server: Any, run: WalkRun, log: WalkLog, stop: Callable[[], bool] | None) -> str | None:
    scene, parts, turn = server.scene, parts_of(run.walker), surroundings.upright(log)
    # The structure as it stands in the pictures: up is away from it
    scene.set_up_direction("+z")
    _look(server, log, turn, DISTANCE * surroundings.scale(run.walker))
    scene.add_frame("/walk", show_axes=False, wxyz=quaternion(turn.rotation)[TO_MUJOCO], position=turn.translation)
    _add_structure(scene, run, log)
    handles = [_add_part(scene, k, part) for k, part in enumerate(parts)]
    marks = [_add_mark(scene, run, k) for k in range(len(run.walker.arms))]
    chosen = np.linspace(0, len(log) - 1, int(np.clip(log.t[-1] * RATE, 2, MOST))).round().astype(int)
    _show(run, log, int(chosen[0]), parts, handles, marks)
    serializer = server.get_scene_serializer()
    for before, row in itertools.pairwise(chosen):
        if stop is not None and stop():
            return None
        serializer.insert_sleep(float(log.t[row] - log.t[before]))
        _show(run, log, int(row), parts, handles, marks)
    return str(serializer.as_html())


def _look(server: Any, log: WalkLog, turn: pin.SE3, distance: float) -> None:
    middle = turn.rotation @ log.pose_body_in_structure[:, :3].mean(axis=0) + turn.translation - [0.0, 0.0, 0.6]
    flat = np.cos(ELEVATION)
    direction = np.array([flat * np.cos(AZIMUTH), flat * np.sin(AZIMUTH), np.sin(ELEVATION)])
    server.initial_camera.position = middle + distance * direction
    server.initial_camera.look_at = middle


def _add_structure(scene: Any, run: WalkRun, log: WalkLog) -> None:
    rows = surroundings.near_rows(run.structure, log, SHOWN * surroundings.scale(run.walker))
    for name, triangles, colour in (
        ("surface", surroundings.surface_triangles(run.structure, rows), surroundings.SURFACE),
        ("holds", surroundings.stud_triangles(run.structure, rows), surroundings.HOLD),
        ("obstacles", surroundings.obstacle_triangles(run.structure, rows), surroundings.OBSTACLE),
    ):
        if len(triangles):
            _add_mesh(scene, f"/walk/{name}", triangles, colour, flat=name != "surface")
    points = log.pose_body_in_structure[:: max(1, len(log) // 200), :3].astype(np.float32)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    scene.add_line_segments("/walk/path", pieces, (31, 95, 168), thickness=3.0, thickness_units="screen")


def _add_part(scene: Any, number: int, part: Part) -> Any:
    mesh = simplified(render.triangles(PlacedShape(part.shape, pin.SE3.Identity())), DETAIL)
    return _add_mesh(scene, f"/walk/machine/{number} {part.link}", mesh, part.colour)


def _add_mark(scene: Any, run: WalkRun, arm: int) -> Any:
    """The hold that an arm holds, in its colour."""
    stud = surroundings.stud_triangles(run.structure, np.array([0]), 1.7)
    frame = run.structure.frames[0]
    local = (stud - frame[:3, 3]) @ frame[:3, :3]
    name = f"/walk/hold of {run.walker.arms[arm].name}"
    return _add_mesh(scene, name, local, surroundings.mixed(surroundings.arm_colour(arm), PALE_HAND))


def _add_mesh(scene: Any, name: str, triangles: Array, colour: surroundings.Colour, flat: bool = False) -> Any:
    corners, places = np.unique(triangles.reshape(-1, 3).round(5), axis=0, return_inverse=True)
    return scene.add_mesh_simple(
        name,
        corners.astype(np.float32),
        places.reshape(-1, 3).astype(np.uint32),
        color=tuple(round(255 * part) for part in colour),
        flat_shading=flat,
        side="double",
    )


def _show(run: WalkRun, log: WalkLog, row: int, parts: list[Part], handles: list[Any], marks: list[Any]) -> None:
    """Everything that moves, at a row of the log."""
    poses = part_poses(run.walker, parts, configuration(run.walker, log, row))
    for handle, pose in zip(handles, poses, strict=True):
        handle.position, handle.wxyz = pose.translation, quaternion(pose.rotation)[TO_MUJOCO]
    held = {arm: hold for hold, arm in held_by(log, row).items()}
    for arm, mark in enumerate(marks):
        if bool(mark.visible) != (arm in held):
            mark.visible = arm in held
        if arm in held:
            frame = run.structure.frames[held[arm]]
            if not np.allclose(mark.position, frame[:3, 3], atol=1e-6):
                mark.position, mark.wxyz = frame[:3, 3], quaternion(frame[:3, :3])[TO_MUJOCO]
