"""Draws pictures of the pages, from examples that draw none themselves and of a walk among posts:
``python -m bench.pictures [--only FILE]``.
"""

from __future__ import annotations

import argparse
import runpy
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

import wbc
from bench.gallery import save
from bench.pool import ROOT
from tests.plan.scenes import SHELF, panda
from wbc.climb.grids import plane_grid
from wbc.climb.loop import ClimbOutcome
from wbc.climb.report.pictures import ClimbPictures
from wbc.climb.request import ClimbRequest, PathRequest, SceneRequest
from wbc.climb.scene import SceneBody
from wbc.climb.scene_files import save_scene
from wbc.climb.session import climb
from wbc.track import Scene, render

SIZE, SMALL = (800, 540), (480, 330)
#: Pictures of a film, and how far round the path of a hand there is something to see [m]
FRAMES, ROUND = 24, 0.5
#: A hand that points away from the robot
FORWARDS = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
#: Pictures of a walk, and how long each is shown [s]
STEPS, SHOWN = 60, 0.2
#: Posts of it, and the seed that they are drawn from
POSTS, POSTS_SEED = 8, 2


def dual_arm(run: dict[str, Any], file: Path) -> None:
    """PR2 and its box at three times."""
    robot, path = run["robot"], run["path"]
    scene = Scene(robot, dark=run["hands"], detail=0.003)
    apart = np.linalg.norm(np.subtract(*(robot.pose(robot.neutral, hand).translation for hand in run["hands"])))
    board = wbc.shapes.Box((0.3, float(apart) - 0.06, 0.02))
    for share, pale in ((0.35, False), (0.667, True), (0.0, True)):
        q, _ = path[int(share * len(path))]
        if not pale:
            scene.add_robot(q)
        scene.add_shape(board, robot.pose(q, "box_left"), "" if pale else "box", pale=pale)
    scene.add_path(np.array([place for _, place in path]), "path of its middle")
    scene.save(file, size=SIZE, azimuth=0.7)


def mobile_base(run: dict[str, Any], file: Path) -> None:
    """TIAGo at two times, with the paths of hand and base."""
    robot, path = run["robot"], run["path"]
    scene = Scene(robot, dark=[run["tip"]], detail=0.005)
    scene.add_robot(path[518][0])
    scene.add_robot(path[248][0], pale=True)
    scene.add_path(np.array([hand for _, hand, _ in path]), "path of the hand", radius=0.012)
    floor = np.array([[*base[:2], 0.02] for _, _, base in path])
    scene.add_path(floor, "path of the base", (0.9, 0.5, 0.1), radius=0.012)
    scene.save(file, size=SIZE, azimuth=3.3, elevation=0.6)


def film(run: dict[str, Any], file: Path) -> None:
    """TIAGo's run from its beginning to its end, with the path of its hand, from where the camera stands still."""
    hands = np.array([hand for _, hand, _ in run["path"]])
    low, high = hands.min(axis=0) - ROUND, hands.max(axis=0) + ROUND
    low[2] = 0.0
    corners = np.array(list(product(*np.stack([low, high], axis=1))))
    scene = Scene(run["robot"], dark=[run["tip"]], detail=0.006)
    scene.add_path(hands, radius=0.012)
    frame = scene.film(render.framed(corners, SMALL, 3.3, 0.6))
    frames = []
    for k in np.linspace(0, len(hands) - 1, FRAMES, endpoint=False).astype(int):
        scene.add_robot(run["path"][k][0])
        frames.append(Image.fromarray(frame()))
    save(frames, file)


def posts(_: dict[str, Any], file: Path) -> None:
    """The published walker along a plane among posts of a seed, over the low ones and between the high ones."""
    rng, scene = np.random.default_rng(POSTS_SEED), plane_grid()
    low, high = scene.positions.min(axis=0), scene.positions.max(axis=0)
    bodies = dict(scene.bodies)
    for k in range(POSTS):
        foot, tall = rng.uniform(low, high), float(rng.uniform(0.3, 1.7))
        middle = wbc.SE3(np.eye(3), foot + [0.0, 0.0, tall / 2.0])
        bodies[f"post {k}"] = SceneBody(wbc.shapes.Capsule(float(rng.uniform(0.02, 0.06)), tall), middle)
    with TemporaryDirectory() as folder:
        there = save_scene(replace(scene, bodies=bodies, name="posts"), Path(folder) / "posts.csv")
        mode = PathRequest(start="8,6", points=("8,17",), speed=0.1)
        done = climb(ClimbRequest(mode, scene=SceneRequest(scene=str(there))))
    if done.report is None or not done.report.clean or done.run.outcome is not ClimbOutcome.ARRIVED:
        raise SystemExit(f"the walk among posts: {done.run.outcome} {done.run.reason} {done.report}")
    save([image for _, image in ClimbPictures(done.run).frames(SMALL, STEPS)], file, SHOWN)


def shelf(_: dict[str, Any], file: Path) -> None:
    """A Panda's planned law out of one cell of a shelf and into another one."""
    stack = panda(*SHELF)
    planner, neutral = stack.planner(), stack.robot.neutral
    into, target = (wbc.SE3(FORWARDS, np.array(place)) for place in ((0.58, 0.22, 0.22), (0.58, -0.22, 0.57)))
    path = planner.plan(planner.plan(neutral, {"hand": into}).q[-1], {"hand": target}, paths=8)
    law = path.law()
    scene = Scene(stack.robot, dark=["panda_hand"], detail=0.004)
    for k, (sides, place) in enumerate(SHELF):
        scene.add_shape(wbc.shapes.Box(sides), wbc.SE3(np.eye(3), np.array(place)), f"board {k}", (0.75, 0.66, 0.5))
    q, _v = path.configurations(law, np.linspace(0.0, law.duration, 2 * FRAMES))
    scene.add_path(np.array([stack.robot.pose(x, "panda_hand_tcp").translation for x in q]), radius=0.006)
    corners = np.array(list(product((-0.1, 0.8), (-0.5, 0.5), (0.0, 0.9))))
    frame, frames = scene.film(render.framed(corners, SMALL, 4.2, 0.45)), []
    for x in q:
        scene.add_robot(x)
        frames.append(Image.fromarray(frame()))
    save(frames, file)


#: File -> the example that it is drawn from, "" for none, and how
PICTURES: dict[str, tuple[str, Callable[[dict[str, Any], Path], None]]] = {
    "dual_arm.png": ("dual_arm", dual_arm),
    "mobile_base.png": ("mobile_base", mobile_base),
    "mobile_base_film.gif": ("mobile_base", film),
    "walk_posts.gif": ("", posts),
    "plan_shelf.gif": ("", shelf),
}


def main() -> None:
    """Run the examples and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    parser.add_argument("--only", nargs="+", choices=list(PICTURES), default=list(PICTURES))
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    for name in chosen.only:
        example, draw = PICTURES[name]
        run = runpy.run_path(str(ROOT / "examples" / f"{example}.py"), run_name="__main__") if example else {}
        draw(run, chosen.out / name)
        print(chosen.out / name)


if __name__ == "__main__":
    main()
