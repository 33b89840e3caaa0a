"""Still pictures of a walk: the machine on the structure, at several instants and once over its whole way."""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wbc.multibody import pin
from wbc.track.scene import Scene
from wbc.walking.log.log import CLOSED, OPENING, WalkLog
from wbc.walking.report import surroundings
from wbc.walking.report.parts import joining_pieces, link_colours, part_poses
from wbc.walking.run.recording import configuration
from wbc.walking.run.session import WalkRun

#: Where pictures look from [rad]: 0 is ahead of the body, and above level
AZIMUTH, ELEVATION = np.radians(-58.0), np.radians(30.0)
#: Holds that are shown lie within this of the body's way [m]
SHOWN = 1.6
#: Studs of holds that are held are drawn so many times as large
HELD = 1.7
#: Stills of instants at most, and width and height of pictures [pixels]
COUNT, SIZE = 3, (960, 640)


def save_stills(
    run: WalkRun,
    log: WalkLog,
    folder: pathlib.Path,
    size: tuple[int, int] | None = None,
    stop: Callable[[], bool] | None = None,
) -> list[pathlib.Path]:
    """``walk.png``, the machine at the beginning, in the middle and at the end of its way, and ``still_1.png``, ...

    Args:
        size: width and height [pixels]; default: :data:`SIZE`. stop: asked between two pictures; true ends it.
    """
    files = [save_overview(run, log, folder / "walk.png", size)]
    swings = swing_rows(log)
    chosen = np.unique(np.linspace(0, len(swings) - 1, COUNT).round().astype(int))
    for number, k in enumerate(swings[chosen], start=1):
        if stop is not None and stop():
            break
        scene = new_scene(run)
        add_structure(scene, run, log, held_by(log, int(k)))
        add_machine(scene, run, log, int(k))
        files.append(scene.save(folder / f"still_{number}.png", size or SIZE, AZIMUTH, ELEVATION))
    return files


def save_overview(run: WalkRun, log: WalkLog, file: pathlib.Path, size: tuple[int, int] | None = None) -> pathlib.Path:
    """One picture of the whole walk: the machine in its middle, pale where it began and ended, and the body's way."""
    scene, swings = new_scene(run), swing_rows(log)
    middle = int(swings[len(swings) // 2])
    add_structure(scene, run, log, held_by(log, middle))
    add_machine(scene, run, log, middle)
    for k in (0, len(log) - 1):
        add_machine(scene, run, log, k, pale=True)
    way = log.pose_body_in_structure[:, :3] @ surroundings.upright(log).rotation.T
    scene.add_path(way, "path of the body")
    return scene.save(file, size or SIZE, AZIMUTH, ELEVATION)


def new_scene(run: WalkRun, detail: float = 0.0) -> Scene:
    """An empty scene for the machine, its arms in their colours; ``detail`` as of :class:`Scene`."""
    return Scene(run.walker.robot, detail=detail, colours=link_colours(run.walker), floor=False)


def add_machine(scene: Scene, run: WalkRun, log: WalkLog, row: int, pale: bool = False) -> None:
    """The machine at a row of the log, with the pieces that join its shapes."""
    q = configuration(run.walker, log, row)
    q[:7] = pin.SE3ToXYZQUAT(surroundings.upright(log) * pin.XYZQUATToSE3(q[:7]))
    parts = joining_pieces(run.walker, link_colours(run.walker))
    poses = part_poses(run.walker, parts, q)
    scene.add_robot(q, pale, [(part.shape, pose, part.colour) for part, pose in zip(parts, poses, strict=True)])


def add_structure(scene: Scene, run: WalkRun, log: WalkLog, held: dict[int, int]) -> None:
    """The structure near the way; ``held``: row of a hold -> arm, in whose colour it is."""
    turn = surroundings.upright(log).rotation.T
    rows = surroundings.near_rows(run.structure, log, SHOWN)
    scene.add_triangles(surroundings.surface_triangles(run.structure, rows) @ turn, colour=surroundings.SURFACE)
    plain = np.setdiff1d(rows, list(held))
    scene.add_triangles(surroundings.stud_triangles(run.structure, plain) @ turn, colour=surroundings.HOLD)
    scene.add_triangles(surroundings.obstacle_triangles(run.structure, rows) @ turn, colour=surroundings.OBSTACLE)
    add_held(scene, run, log, held)


def add_held(scene: Scene, run: WalkRun, log: WalkLog, held: dict[int, int]) -> None:
    """The holds that are held, in the colours of their arms; ``held``: row of a hold -> arm."""
    turn = surroundings.upright(log).rotation.T
    for row, arm in held.items():
        stud = surroundings.stud_triangles(run.structure, np.array([row]), HELD) @ turn
        scene.add_triangles(stud, colour=surroundings.mixed(surroundings.arm_colour(arm), 0.1))


def held_by(log: WalkLog, row: int) -> dict[int, int]:
    """Row of a hold -> arm that holds it, at a row of the log."""
    hands = np.nonzero(np.isin(log.hand_state[row], (CLOSED, OPENING)) & (log.hand_hold[row] >= 0))[0]
    return {int(log.hand_hold[row, arm]): int(arm) for arm in hands}


def swing_rows(log: WalkLog) -> NDArray[np.int64]:
    """Rows in the middle of swings; the first and the last row where there are none."""
    free = ~np.isin(log.hand_state, (CLOSED, OPENING)).all(axis=1)
    edges = np.nonzero(np.diff(np.concatenate([[False], free, [False]])))[0]
    middles = (edges[::2] + edges[1::2]) // 2
    return middles if len(middles) else np.array([0, len(log) - 1])
