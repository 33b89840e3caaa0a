"""The files of a run's folder that are there from its beginning: what was asked for, the holds and the machine."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from wbc.errors import WbcError
from wbc.log import LogFileError
from wbc.robots import Walker, WalkerData, walker
from wbc.robots.walker_robot import CLIMBS, MADE
from wbc.walking.holds.files import save_structure
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import FILE, WalkLog, WalkLogError

#: What was asked for
BEGUN = "begun.json"
PLAN, STRUCTURE, URDF = "plan.json", "structure.csv", "robot.urdf"


def begin_folder(
    folder: pathlib.Path,
    asked: Mapping[str, Any],
    machine: Walker,
    structure: Structure,
    plant: Mapping[str, Any] | None = None,
) -> None:
    """Makes the folder and writes what a run needs to be begun again, gone on with and checked, whenever it ends.

    Args:
        asked: the run's request as plain data. plant: what moves, as plain data; None: the kinematic one.

    Raises:
        WalkLogError, StructureFileError, RobotFileError: a file cannot be written.
    """
    begun = {"request": asked, "machine": machine_of(machine), **({} if plant is None else {"plant": plant})}
    text = json.dumps(begun, indent=1) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WalkLogError("path", str(folder), f"cannot be made: {error.strerror}") from error
    write_whole(folder / BEGUN, lambda file: file.write_text(text))
    save_structure(structure, folder / STRUCTURE)
    write_whole(folder / URDF, machine.urdf)


def machine_of(machine: Walker) -> dict[str, Any]:
    """A machine as plain data, of which :func:`machine_made` makes it again."""
    return {"arms": len(machine.arms), "data": asdict(machine.data)}


def machine_made(plain: Any) -> Walker:
    """The machine of :func:`machine_of`.

    Raises:
        WalkLogError: it is none.
    """
    try:
        values = {name: tuple(value) if isinstance(value, list) else value for name, value in plain["data"].items()}
        if plain.get("two_ended"):
            raise WalkLogError("machine", MADE[1], CLIMBS)
        return walker(plain["arms"], data=WalkerData.read(**values))
    except (KeyError, TypeError, AttributeError, WbcError) as error:
        raise WalkLogError("machine", type(plain).__name__, f"the run does not say what walked: {error}") from error


def write_whole(file: pathlib.Path, write: Callable[[pathlib.Path], Any]) -> pathlib.Path:
    """Has a file written beside its place and renamed into it, so that no reader ever meets half of it; returns it.

    Raises:
        WalkLogError: the file cannot be written. What ``write`` raises.
    """
    fresh = file.with_name(f".{file.name}")
    try:
        write(fresh)
        fresh.replace(file)
    except OSError as error:
        raise WalkLogError("path", str(file), f"cannot be written: {error.strerror}") from error
    return file


def read_begun(folder: pathlib.Path) -> dict[str, Any]:
    """What a run was asked to do, and its machine, as plain data: ``request`` and ``machine`` of ``begun.json``, and
    ``plant``, empty for the kinematic one.

    Raises:
        WalkLogError: no such file, or another one.
    """
    try:
        found = json.loads((folder / BEGUN).read_text())
        plant = dict(found.get("plant", {}))
        return {"request": dict(found["request"]), "machine": dict(found["machine"]), "plant": plant}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise WalkLogError("run", str(folder), f"there is no run in this folder: {error}") from error


def walked(folder: pathlib.Path) -> bool:
    """Whether a folder has a log to go on with: a whole one, none that says what was begun, or some ticks of one."""
    if (folder / FILE).is_file() or not (folder / BEGUN).is_file():
        return True
    try:
        return len(WalkLog.load(folder)) > 1
    except LogFileError:
        return False
