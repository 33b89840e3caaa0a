"""The problems, as plain numbers that every contender reads: needs numpy only.

A problem is a folder with ``problem.json`` (:class:`Problem`), ``targets.npz`` and ``robot.urdf``, written once
by ``bench.prepare``, so that no contender computes its own targets.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solid:
    """A collision shape that all contenders get.

    Attributes:
        link: the link that carries it; several may be on one. ``""``: fixed in the world.
        kind: ``sphere``, ``capsule`` (axis z; ``size`` is radius, distance of the ends) or ``box`` (full sides).
        size: [m].
        place: of its centre in the link's frame [m].
        turn: its orientation in the link's frame, a quaternion (x, y, z, w).
    """

    link: str
    kind: str
    size: list[float]
    place: list[float]
    turn: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Problem:
    """One control problem.

    Attributes:
        name: short name.
        title: what is asked, in one line.
        robot: name that ``wbc.robots.load`` takes; "": it is loaded from the URDF.
        floating: whether the root is a free joint.
        joints: the one-dof joints in Pinocchio's order.
        frames: frames with a pose task.
        com: whether there is a centre-of-mass task.
        q0: first configuration: base position and quaternion (x, y, z, w) if floating, then the joints.
        length: metres that weigh as much as one radian [m].
        posture_weight: weight of the posture task; pose and centre-of-mass tasks have weight 1.
        damping: added to the diagonal of the Hessian.
        dt: tick [s].
        margin: smallest distance allowed [m].
        rate: a distance d above the margin may shrink by at most rate * d [1/s].
        solids: collision shapes, on links and in the world; :attr:`pairs` says which keep clear.
        pairs: pairs of indices into :attr:`solids`.
        sensed: rows for the nearest pairs, which Coal measures (this package); 0: every pair has a row of its own.
    """

    name: str
    title: str
    joints: list[str]
    frames: list[str]
    q0: list[float]
    length: float
    robot: str = ""
    floating: bool = False
    com: bool = False
    posture_weight: float = 1e-3
    damping: float = 1e-8
    dt: float = 0.005
    margin: float = 0.01
    rate: float = 100.0
    solids: list[Solid] = field(default_factory=list)
    pairs: list[tuple[int, int]] = field(default_factory=list)
    sensed: int = 0


@dataclass(frozen=True)
class Case:
    """A problem with its targets.

    Attributes:
        problem: what is asked.
        urdf: the description that all contenders share.
        poses: target of each frame at each tick, ticks x frames x 4 x 4.
        com: target of the centre of mass at each tick, ticks x 3 [m].
    """

    problem: Problem
    urdf: Path
    poses: Array
    com: Array

    @property
    def ticks(self) -> int:
        """Ticks of one pass along the path."""
        return len(self.poses)

    @property
    def q0(self) -> Array:
        """First configuration."""
        return np.array(self.problem.q0)


def save(folder: Path, problem: Problem, poses: Array, com: Array) -> None:
    """Write ``problem.json`` and ``targets.npz``."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "problem.json").write_text(json.dumps(asdict(problem), indent=1))
    np.savez(folder / "targets.npz", poses=poses, com=com)


def load(folder: Path) -> Case:
    """Read what :func:`save` wrote."""
    stored = json.loads((folder / "problem.json").read_text())
    problem = Problem(**stored | {"solids": [Solid(**solid) for solid in stored["solids"]]})
    with np.load(folder / "targets.npz") as data:
        return Case(problem, folder / "robot.urdf", data["poses"], data["com"])
