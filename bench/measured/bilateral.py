"""Bilateral teleoperation over delay: what is refused without passivity control, and a picture."""

from __future__ import annotations

import dataclasses

import numpy as np

from bench.pool import ROOT
from bench.sheet import Sheet
from tests.teleop.bilateral_runs import DT, reach
from wbc import style
from wbc.errors import RangeError
from wbc.teleop.bilateral import (
    Bilateral,
    BilateralRecord,
    Channel,
    Device,
    Operator,
    Scheme,
    Wall,
    four_channel,
    position_force,
    position_position,
    run_bilateral,
)

PICTURE = ROOT / "docs" / "images" / "bilateral.png"
DEVICE, LIGHT = Device(2.0, 15.0), Device(2.0, 10.0)
SCHEMES = {
    "position-position": position_position(), "position-force": position_force(), "four-channel": four_channel(),
}  # fmt: skip
WALL = Wall(0.15)
SECONDS = 8.0


def parts() -> dict[str, Sheet | str]:
    """What is accepted without passivity control, and the picture."""
    _picture()
    return {"accepted": _accepted()}


def _accepted() -> Sheet:
    """Round trips up to which a scheme is accepted without passivity control, by damping of both devices."""
    rows = []
    for name, scheme in SCHEMES.items():
        cells = [name]
        for damping in (6.0, 15.0, 40.0, 100.0):
            trips = [2 * n * DT for n in range(81) if _fits(scheme, Device(2.0, damping), n * DT)]
            cells.append(f"{1e3 * max(trips):.0f}" if trips else "none")
        rows.append(tuple(cells))
    return Sheet("", ("scheme", "6 N s/m", "15 N s/m", "40 N s/m", "100 N s/m"), rows)


def _fits(scheme: Scheme, device: Device, delay: float) -> bool:
    try:
        Bilateral(scheme, device, device, Channel(delay), Channel(delay), DT, passivity=False)
    except RangeError:
        return False
    return True


def _picture() -> None:
    """Forces that are late, on a wall, without passivity control and with it, and four channels."""
    free = Bilateral(
        SCHEMES["position-force"], LIGHT, LIGHT, Channel(0.3), Channel(0.3), DT, passivity=False, unchecked=True
    )
    passive = Bilateral(SCHEMES["four-channel"], DEVICE, DEVICE, Channel(0.3), Channel(0.3), DT)
    systems = [free, dataclasses.replace(free, passivity=True), passive]
    run = run_bilateral(systems, [Operator(reach(seconds=SECONDS), k) for k in (100.0, 100.0, 400.0)], [WALL] * 3)
    titles = ("position-force, no control", "position-force, passive", "four-channel, passive")
    with style.pyplot() as plt:
        figure, panels = plt.subplots(3, 3, figsize=(12.0, 7.2), layout="constrained", sharex=True)
        for k, title in enumerate(titles):
            _column(panels[:, k], run, k)
            panels[0, k].set_title(title)
            panels[2, k].set_xlabel("time [s]")
        for panel, label in zip(panels[:, 0], ("position [m]", "force [N]", "energy [J]"), strict=True):
            panel.set_ylabel(label)
            panel.legend(loc="best")
        figure.savefig(PICTURE)
        plt.close(figure)


def _column(panels: np.ndarray, run: BilateralRecord, k: int) -> None:
    time = run.time
    panels[0].set_ylim(-0.2, 0.35)
    panels[1].set_ylim(-45, 65)
    panels[0].axhline(WALL.at, color=style.GREY, lw=0.8, ls=":")
    panels[0].plot(time, run.master[:, k, 0], color=style.BLUE, label="master")
    panels[0].plot(time, run.slave[:, k, 0], color=style.ORANGE, label="slave")
    panels[1].plot(time, run.operator_force[:, k, 0], color=style.BLUE, label="operator")
    panels[1].plot(time, -run.wall_force[:, k, 0], color=style.ORANGE, label="on the wall")
    panels[2].plot(time, run.taken[:, k], color=style.TEAL, label="taken in")
    panels[2].plot(time, run.given[:, k], color=style.RED, label="given out")
