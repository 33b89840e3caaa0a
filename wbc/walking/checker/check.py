"""Checks a walk: what holds is computed anew from the log, the URDF, the holds and the structure."""

from __future__ import annotations

import os
import pathlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wbc.errors import ShapeError
from wbc.validation import Array
from wbc.walking.checker import clearances, clock_and_joints, grasps, swept, table_of_holds
from wbc.walking.checker.body import Bodies, Hands, estimate, single
from wbc.walking.checker.holds import HoldTable, turns_between
from wbc.walking.checker.report import Report, Tally
from wbc.walking.checker.rules import Rules
from wbc.walking.checker.samples import Samples, blocks
from wbc.walking.checker.urdf import Placements, Urdf, forward, read_urdf
from wbc.walking.holds.files import read_structure
from wbc.walking.holds.structure import Structure
from wbc.walking.log.log import WalkLog

#: Names of the files in a run's folder
URDF_FILE, STRUCTURE_FILE = "robot.urdf", "structure.csv"

Path = str | os.PathLike[str]


def check_run(run: Path, rules: Rules | None = None) -> Report:
    """Checks the walk in a run's folder: ``run.npz``, ``robot.urdf`` and ``structure.csv``.

    Raises:
        WalkLogError, RobotFileError, StructureFileError: a file that is missing or cannot be read.
        What :func:`check_walk` raises.
    """
    folder = pathlib.Path(run)
    return check_walk(folder, folder / URDF_FILE, folder / STRUCTURE_FILE, rules)


def check_walk(
    log: WalkLog | Path, urdf: Path, structure: Structure | Path | None = None, rules: Rules | None = None
) -> Report:
    """Whether a walk is one that the machine can do; every number is computed anew from the joints.

    The body's pose at each tick and at samples between ticks follows from the holding hands' forward kinematics alone:
    X = hold hand^-1 for holds that fix all freedoms, else the least-squares pose over all holding hands.

    Args:
        log: or its file, or the run's folder.
        urdf: its root link is the body, its collision bodies spheres and cylinders.
        structure: or its file; None: the holds of the log alone, each with the plane across its axis as the surface.
        rules: limits; default: those of :class:`Rules`.

    Raises:
        WalkLogError, StructureFileError, RobotFileError, UnsupportedJointError: a file that cannot be read.
        UnknownNameError: a joint or hand that the URDF does not have, or a check in ``rules.observe``
            that is none. ShapeError: a log without the joints it needs.
    """
    used = rules or Rules()
    if not isinstance(log, WalkLog):
        log = WalkLog.load(log)
    if structure is not None and not isinstance(structure, Structure):
        structure = read_structure(structure)
    machine, tally = read_urdf(urdf), Tally(used.observe)
    _check_names(log, machine)
    table = HoldTable.of(log)
    for declare in (table_of_holds.declare, clock_and_joints.declare, clearances.declare, swept.declare):
        declare(tally, used)
    grasps.declare(tally, used, log)
    _declare(tally, used)
    tally.check_observed()
    table_of_holds.check_table(log, table, structure, tally)
    clock_and_joints.check_time(log, tally)
    clock_and_joints.check_rates(log, machine, tally)
    clock_and_joints.check_accelerations(log, used, tally)
    clock_and_joints.check_twist(log, used, tally)
    clock_and_joints.check_jumps(log, tally)
    swept.check_swept(log, machine, urdf, structure, used, tally)
    grasps.check_counts(log, used, tally)
    grasps.check_states(log, used, tally)
    grasps.check_shared(log, tally)
    around = clearances.Surroundings.of(structure, table, used)
    at_ticks, samples, loose = _AtTicks.empty(log), 0, 0
    for block in blocks(log, used.sub_samples):
        clock_and_joints.check_positions(block, log, machine, tally)
        placements = forward(machine, log.joints, block.q)
        hands = _hands(log, placements)
        bodies = _bodies(log, hands, table, block)
        _check_holds(log, hands, bodies, table, block, tally, at_ticks)
        _check_body(log, hands, bodies, table, block, tally)
        clearances.check_links(machine, placements, block, used, tally)
        placed = _placed(placements, bodies)
        at = {hand: placed.position[hand] for hand in log.hands}
        clearances.check_structure(machine, placed, block, around, at, used, tally)
        samples, loose = samples + len(block), loose + int(bodies.open.sum())
    grasps.check_closing(log, at_ticks.distance, at_ticks.angle, at_ticks.speed, at_ticks.rate, tally)
    grasps.check_drift(log, at_ticks.distance, at_ticks.angle, tally)
    return Report(
        tally.findings(), len(log), samples, float(log.t[-1] - log.t[0]), loose, tally.findings(observed=True)
    )


@dataclass(frozen=True, eq=False)
class _AtTicks:
    """Off the hold, and motion to the next tick, of every hand: [n, a] each."""

    distance: Array
    angle: Array
    speed: Array
    rate: Array

    @classmethod
    def empty(cls, log: WalkLog) -> _AtTicks:
        return cls(*np.zeros((4, *log.hand_hold.shape)))


def _declare(tally: Tally, rules: Rules) -> None:
    tally.declare("held hand off its hold", rules.hold_distance, "m")
    tally.declare("held hand's tilt beyond max_tilt", rules.hold_angle, "rad")
    tally.declare("held hand's roll", rules.hold_angle, "rad")
    tally.declare("body position", rules.body_distance, "m")
    tally.declare("body turn", rules.body_angle, "rad")


def _check_names(log: WalkLog, machine: Urdf) -> None:
    for name in log.joints:
        machine.joint(name)
    for hand in log.hands:
        machine.carried_with(hand)
    missing = [joint.name for joint in machine.joints if joint.turns and joint.name not in log.joints]
    if missing:
        raise ShapeError("WalkLog.joints", missing[0], "the URDF has this joint, the log does not")


def _hands(log: WalkLog, placements: Placements) -> Hands:
    return Hands(
        np.stack([placements.position[hand] for hand in log.hands], axis=1),
        np.stack([placements.rotation[hand] for hand in log.hands], axis=1),
    )


def _bodies(log: WalkLog, hands: Hands, table: HoldTable, block: Samples) -> Bodies:
    """The body out of the holding hands; where it is declared fixed, as logged."""
    fixed = log.body_fixed[block.tick]
    return estimate(hands, block.hold, block.held & ~fixed[:, None], table, block.position, block.rotation)


def _placed(placements: Placements, bodies: Bodies) -> Placements:
    """Placements in the structure's frame."""
    rotation = {link: bodies.rotation @ turn for link, turn in placements.rotation.items()}
    position = {
        link: (bodies.rotation @ at[..., None])[..., 0] + bodies.position for link, at in placements.position.items()
    }
    return Placements(rotation, position)


def _check_holds(
    log: WalkLog, hands: Hands, bodies: Bodies, table: HoldTable, block: Samples, tally: Tally, out: _AtTicks
) -> None:
    """Held hands at their holds, on the body that they give and on the body as logged; fills ``out``."""
    row = np.maximum(block.hold, 0)
    own, logged = hands.placed(bodies.position, bodies.rotation), hands.placed(block.position, block.rotation)
    for placed, body in ((own, "body from the hands"), (logged, "body as logged")):
        offsets = table.offsets(row, placed.position, placed.rotation)
        kinds = ("held hand off its hold", "held hand's tilt beyond max_tilt", "held hand's roll")
        sample, arm = np.nonzero(block.held)

        def where(k: int, sample: NDArray[np.int64] = sample, arm: NDArray[np.int64] = arm, body: str = body) -> str:
            return f"{log.arms[arm[k]]}: {grasps.hold_name(log, block.hold[sample[k], arm[k]])}, {body}"

        for kind, values in zip(kinds, offsets, strict=True):
            tally.add(kind, values[block.held], block.t[sample], where)
        if placed is own:
            ticks = block.tick[block.starts]
            out.distance[ticks] = offsets[0][block.starts]
            out.angle[ticks] = np.maximum(offsets[1], offsets[2])[block.starts]
    _fill_motion(block, own, table, out)


def _fill_motion(block: Samples, placed: Hands, table: HoldTable, out: _AtTicks) -> None:
    """Speeds from a tick to its last sample, over which the same hands hold: of the hand, and of its axis or frame."""
    last = np.append(block.starts[1:], len(block)) - 1
    first = block.starts
    some = last > first
    first, last = first[some], last[some]
    gap = np.maximum(block.t[last] - block.t[first], 1e-12)[:, None]
    ticks = block.tick[first]
    out.speed[ticks] = np.linalg.norm(placed.position[last] - placed.position[first], axis=2) / gap
    before, after = placed.rotation[first], placed.rotation[last]
    z = np.arctan2(
        np.linalg.norm(np.cross(before[..., 2], after[..., 2]), axis=-1), (before[..., 2] * after[..., 2]).sum(axis=-1)
    )
    rolls = table.roll[np.maximum(block.hold[first], 0)] > 0
    out.rate[ticks] = np.where(rolls, turns_between(before, after), z) / gap


def _check_body(log: WalkLog, hands: Hands, bodies: Bodies, table: HoldTable, block: Samples, tally: Tally) -> None:
    """The logged body against that of all holding hands, and of each hand whose hold fixes it."""
    tally.add(
        "body position",
        np.linalg.norm(bodies.position - block.position, axis=1),
        block.t,
        lambda _: "from all holding hands",
    )
    tally.add("body turn", turns_between(bodies.rotation, block.rotation), block.t, lambda _: "from all holding hands")
    row = np.maximum(block.hold, 0)
    alone = block.held & (table.roll[row] > 0) & (table.max_tilt[row] == 0.0)
    for arm, name in enumerate(log.arms):
        at = np.flatnonzero(alone[:, arm])
        if not len(at):
            continue
        near = block.rotation[at] @ hands.rotation[at, arm]
        position, rotation = single(hands.position[at, arm], hands.rotation[at, arm], table, row[at, arm], near)

        def where(k: int, name: str = name, holds: NDArray[np.int64] = row[at, arm]) -> str:
            return f"from {name} at {grasps.hold_name(log, holds[k])}"

        tally.add("body position", np.linalg.norm(position - block.position[at], axis=1), block.t[at], where)
        tally.add("body turn", turns_between(rotation, block.rotation[at]), block.t[at], where)
