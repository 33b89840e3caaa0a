"""The published walker on request: what it does on the same path, with ideal tracking, and where it stops."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from wbc import style, validation
from wbc.climb.grids import INCH, PITCH, RADIUS, GridPlace, cylinder_grid, grid_angle, grid_place
from wbc.climb.scene import ClimbScene
from wbc.errors import RangeError, ShapeError, UnknownNameError
from wbc.published.three_arm_walker import PublishedLog, PublishedOutcome, PublishedWalker, WalkerCalibration
from wbc.track.page import stretches
from wbc.track.summary import Figure

FILE = "published.npz"
PLOT = "holds.png"
#: The body is there when it is this near [grid units]
THERE = 0.2
#: Speed when nothing is said: 4 in/s [m/s]
SPEED = 4 * INCH
#: Turn rate when nothing is said [rad/s]
TURN_RATE = 0.05
#: Of the body over the holds [m]
HEIGHT = 52 * INCH
#: By so much of what was asked for the body's speed may be above it, a cycle being an arc
ROUNDING = 1e-3


@dataclass(frozen=True, eq=False)
class PublishedRun:
    """What the published walker did.

    Attributes:
        scene: the published cylinder, less some holds. speed, turn_rate: that were asked for [m/s, rad/s].
        log: cycles of 0.1 s. outcomes: one a mode, in the order in which they ran.
        arrived: the body ended where it was to go. reason: why not, else "".
    """

    scene: ClimbScene
    speed: float
    turn_rate: float
    log: PublishedLog
    outcomes: tuple[PublishedOutcome, ...]
    arrived: bool
    reason: str


def perform_published(
    scene: ClimbScene, places: Sequence[Any], objective: Literal["velocity", "destination"] = "velocity",
    speed: float = SPEED, turn_rate: float = TURN_RATE,
) -> PublishedRun:  # fmt: skip
    """Walks as the source does.

    Args:
        scene: ``cylinder_grid``, less some footholds.
        places: where the body begins, and where it goes: as of :func:`wbc.climb.grids.grid_place`.
        objective: ``destination``: destination control; ``velocity``: velocity control from place to place.
        speed, turn_rate: of velocity control [m/s, rad/s].

    Raises:
        UnknownNameError: another scene or objective. ShapeError, RangeError, NotFiniteError: fewer than two places, or
            such as the grid has not, no speeds. What the walker raises.
    """
    whole, footholds = cylinder_grid(), validation.instance("scene", scene, ClimbScene, "a ClimbScene").footholds
    if scene.name != whole.name:
        raise UnknownNameError("scene", scene.name, (whole.name,))
    validation.one_of("objective", objective, ("velocity", "destination"))
    speed = validation.scalar("speed", speed, low=0.0, open_low=True, unit="m/s")
    turn_rate = validation.scalar("turn_rate", turn_rate, low=0.0, open_low=True, unit="rad/s")
    points = [grid_place(f"place {k + 1}", place) for k, place in enumerate(validation.items("places", places))]
    if len(points) < 2:
        raise ShapeError("places", places, "expected where it begins and where it goes")
    there = {foothold.id for foothold in footholds}
    removed = [tuple(map(int, hold.id.split(","))) for hold in whole.footholds if hold.id not in there]
    walker = PublishedWalker(points[0][:2], points[0].heading, removed=removed)
    outcomes = list[PublishedOutcome]()
    if objective == "destination":
        outcomes.append(walker.to(points[1:]))
    else:
        for point in points[1:]:
            outcomes.append(_driven(walker, point, speed, turn_rate))
            if outcomes[-1].reason != "time":
                break
    off = np.hypot(walker.place[0] - points[-1][0], walker.place[1] - points[-1][1])
    arrived = bool(off < THERE and outcomes[-1].reason in ("time", "reached"))
    reason = (
        ""
        if arrived
        else f"{outcomes[-1].message or outcomes[-1].reason} at (T, A) = ({walker.place[0]:.2f}, {walker.place[1]:.2f})"
    )
    return PublishedRun(scene, speed, turn_rate, walker.log, tuple(outcomes), arrived, reason)


def published_figures(run: PublishedRun) -> list[Figure]:
    """The figures in the order in which they are shown."""
    text = "arrived" if run.arrived else f"stopped: {run.reason}"
    lifts = sum(len(outcome.lifts) for outcome in run.outcomes)
    last = float(run.log.times[-1]) if len(run.log.times) else 0.0
    time = sum(outcome.time for outcome in run.outcomes)
    speed, spin = _fastest(run.log)
    over = speed > (1.0 + ROUNDING) * run.speed or spin > (1.0 + ROUNDING) * run.turn_rate
    return [
        Figure("outcome", "outcome", "arrived" if run.arrived else "stopped", text),
        Figure("reason", "", run.reason, ""),
        Figure("planner", "planner", "published", "published, ideal tracking, wrist reach only"),
        Figure("robot", "robot", digest := WalkerCalibration().digest, f"published walker, calibration {digest}"),
        Figure(
            "scene",
            "scene",
            {"name": run.scene.name, "footholds": len(run.scene.footholds)},
            f"{run.scene.name}, {len(run.scene.footholds)} footholds",
        ),
        Figure(
            "speed",
            "body",
            {"speed": speed, "turn_rate": spin},
            f"at most {1e3 * speed:.1f} mm/s and {spin:.3f} rad/s about z{', MORE than was asked' if over else ''}",
        ),
        Figure("lifts", "arms lifted", lifts, f"{lifts} times"),
        Figure("duration", "duration", time, f"{time:.1f} s walking, {last:.1f} s with setting down"),
    ]


def _fastest(log: PublishedLog) -> tuple[float, float]:
    """The body's largest speed [m/s] and turn rate about its z axis [rad/s] from cycle to cycle."""
    if len(log.times) < 2:
        return 0.0, 0.0
    steps, turns = np.diff(log.times), np.swapaxes(log.bodies[:-1, :3, :3], 1, 2) @ log.bodies[1:, :3, :3]
    about = np.arctan2(turns[:, 1, 0] - turns[:, 0, 1], turns[:, 0, 0] + turns[:, 1, 1])
    moved = np.linalg.norm(np.diff(log.bodies[:, :3, 3], axis=0), axis=1)
    return float((moved / steps).max()), float((np.abs(about) / steps).max())


def save_published(run: PublishedRun, folder: pathlib.Path) -> list[pathlib.Path]:
    """Writes ``published.npz``, the fields of the walker's log, and a plot of holds over time; returns the files."""
    file, log = folder / FILE, run.log
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(file, allow_pickle=False, **{f.name: np.array(getattr(log, f.name)) for f in fields(log)})
    with style.pyplot() as plt:
        figure, panel = plt.subplots(figsize=(9.2, 3.6), layout="constrained")
        for arm in range(log.supporting.shape[1]):
            on, names = log.supporting[:, arm], log.places[:, arm]
            for start, end in stretches(on):
                left, right = log.times[start], log.times[min(end, len(log.times) - 1)]
                panel.barh(arm + 1, right - left, left=left, height=0.62, color=style.CYCLE[arm], lw=0)
                text = ",".join(str(n) for n in names[start])
                panel.text((left + right) / 2, arm + 1, text, ha="center", va="center", color="white", fontsize=8.5)
        panel.set_yticks([1, 2, 3], ["arm 1", "arm 2", "arm 3"])
        panel.invert_yaxis()
        panel.grid(visible=False, axis="y")
        panel.set_xlabel("time [s]")
        panel.set_title("Published walker: holds over time (T,A)", fontsize=13)
        figure.savefig(folder / PLOT)
        plt.close(figure)
    return [file, folder / PLOT]


def _driven(walker: PublishedWalker, point: GridPlace, speed: float, turn_rate: float) -> PublishedOutcome:
    """Velocity control straight towards a point, for as long as that takes."""
    now = np.array(walker.place)
    off = np.array(point) - now
    radius = RADIUS + HEIGHT
    offset = np.array([(grid_angle(1.0) - grid_angle(0.0)) * radius * off[0], PITCH * off[1]])
    spin = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
    time = max(float(np.linalg.norm(offset)) / speed, abs(spin) / turn_rate)
    if time <= 0.0:
        raise RangeError("to", point, "the body is there already")
    return walker.drive([offset[0] / time, offset[1] / time, spin / time], time)
