"""Draws pictures of the pages from examples that draw none themselves: ``python -m bench.pictures [--out FOLDER]``."""

from __future__ import annotations

import argparse
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import wbc
from bench.pool import ROOT
from wbc.track import Scene

SIZE = (800, 540)


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


PICTURES: dict[str, Callable[[dict[str, Any], Path], None]] = {"dual_arm": dual_arm, "mobile_base": mobile_base}


def main() -> None:
    """Run the examples and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "images")
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        draw(runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__"), folder / f"{name}.png")
        print(folder / f"{name}.png")


if __name__ == "__main__":
    main()
