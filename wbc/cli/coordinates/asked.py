"""What is asked of an analysis and of a drive."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from wbc.cli.coordinates.modes import ArmName, ModeName
from wbc.cli.output import Mcap
from wbc.cli.scene import Backend, RobotName


@dataclass(frozen=True)
class AnalysisAsked:
    """Sets of coordinates, and what is done with them."""

    PANEL: ClassVar[str] = "What is analysed, and what is written"
    robot: RobotName
    set: Annotated[
        tuple[str, ...], "A published set, such as 'elbow, beta, gamma'; may be repeated. Default: all."
    ] = ()
    lock: Annotated[tuple[str, ...], "Joint held as a constraint; may be repeated."] = ()
    point: Annotated[tuple[str, ...], "Frame whose position is a constraint; may be repeated."] = ()
    plane: Annotated[tuple[str, ...], "SHOULDER,WRIST: frames of a pitch plane whose rate is one."] = ()
    frame: Annotated[str | None, "Frame whose pose is the task. Default: the tip."] = None
    algorithm: Annotated[Literal["sub_determinants", "singular_vectors"], "How loci are found."] = "sub_determinants"
    approximate: Annotated[bool, "Rational rotations for inexact ones."] = False
    full: Annotated[bool, "Of spdm the arm with all offsets, with --certify."] = False
    tree: Annotated[bool, "Of spdm all 15 joints, decided by blocks, instead of one arm."] = False
    certify: Annotated[bool, "Prove it by subdivision of joint space as well."] = False
    screen: Annotated[int | None, "Certify the best set of at most so many constraints instead."] = None
    minutes: Annotated[float, "By the clock, for all the work on one set, or for a screen, at most [min]."] = 5.0
    resume: Annotated[Path | None, "Folder to keep certificates in and go on from."] = None
    plot: Annotated[Path | None, "Folder for pictures of the loci."] = None
    latex: Annotated[bool, "Formulas as LaTeX."] = False
    data: Annotated[Path | None, "JSON file for the results."] = None


@dataclass(frozen=True)
class DriveAsked:
    """An arm, its orders, and what is written of a session."""

    PANEL: ClassVar[str] = "How it is driven, and what is written"
    robot: ArmName
    rates: Annotated[Path | None, "CSV file of orders: time, pair, r1 ... r6."] = None
    keys: Annotated[bool, "Orders from the keyboard, at 50 Hz."] = False
    mode: Annotated[
        tuple[ModeName, ...], "Modes whose pairs there are; may be repeated. Default: M1 and M2, where there are such."
    ] = ()
    at: Annotated[str, "First configuration, numbers with commas [rad, m]. Default: away from singular ones."] = ""
    automatic: Annotated[bool, "Change pairs as the adviser says."] = False
    realtime: Annotated[bool, "Wait for the clock with a file, too."] = False
    scaled: Annotated[bool, "Rates that joints are too slow for keep their direction."] = False
    log: Annotated[Path | None, "Write what happened to this CSV file, after Ctrl-C, too."] = None
    teach: Annotated[Path | None, "Write the orders to this CSV file, which --rates carries out again."] = None
    out: Annotated[Path | None, "A folder for log.csv, report.html and replay.html, after Ctrl-C, too."] = None
    mcap: Mcap = False
    force: Annotated[bool, "Write into a folder that has a run."] = False
    backend: Backend = "auto"
