"""What the loop writes down of every tick, by the recorder of all logs."""

from __future__ import annotations

import hashlib
import pathlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.log import FileWriter, Log, TickRecorder
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Components of a wrench in the log, in the axes of the foothold
WRENCH = {"fx": "N", "fy": "N", "fz": "N", "mx": "N m", "my": "N m", "mz": "N m"}
#: Columns of a foothold in the table ``footholds``: position [m], quaternion x, y, z, w, friction
FOOTHOLD_COLUMNS = 8
#: Columns of the table ``presence``: row of a foothold, time [s], 1 where it came then, 0 where it vanished
PRESENCE_COLUMNS = 3
#: Ticks that are written to a file at once
CHUNK = 50


def scene_digest(scene: ClimbScene) -> str:
    """Hash of footholds, bodies and gravity."""
    text = [f"{f.id} {f.on} {f.friction!r} {f.limbs} {f.rolls}" for f in scene.footholds]
    return _digest(scene, text, [f.pose for f in scene.footholds])


def bodies_digest(scene: ClimbScene) -> str:
    """Hash of bodies and gravity."""
    return _digest(scene, [], [])


def _digest(scene: ClimbScene, text: list[str], poses: list[pin.SE3]) -> str:
    bodies = sorted(scene.bodies.items())
    text = text + [f"{name} {_told(body.shape)}" for name, body in bodies]
    poses = poses + [body.placement for _, body in bodies]
    numbers = np.concatenate([np.ravel(pose.homogeneous) for pose in poses] + [np.ravel(scene.gravity)])
    return hashlib.sha256("\n".join(text).encode() + numbers.tobytes()).hexdigest()[:32]


def motion_units(robot: Robot) -> dict[str, str]:
    """Columns of configurations and velocities in a log -> their units."""
    rates = {f"v.{name}": f"{unit}/s" for name, unit in zip(robot.dof_names, robot.dof_units, strict=True)}
    return {f"q.{k}": "m, rad" for k in range(robot.nq)} | rates


class ClimbRecorder:
    """The log of a climb. A row, the first one of the start:

        t, path_time       of the plant's clock, and of the plan [s]
        q.NAME             configuration after the tick [m, rad]; v.DOF the velocity that the plant reports
        u.DOF              what was commanded: velocities [m/s, rad/s], or torques [N m]
        contact.LIMB       row in the run's scene of the foothold that it is closed on, -1 for none
        aim.LIMB           row of the foothold that it is on its way to through the air, -1 for none
        state.LIMB         a ``LimbState``
        wrench.LIMB.fx     ... mz: of a stack of torques what the contact bears, in the axes of the foothold [N, N m]
        kept               whether every row of the stack held

    Its tables: ``footholds``, and of a run in which some vanished or came ``presence``: when, as of
    :data:`PRESENCE_COLUMNS`.

    Args:
        plan: what is carried out. torques: whether torques are commanded.
    """

    def __init__(self, plan: ContactPlan, torques: bool, dt: float) -> None:
        climber, robot = plan.climber, plan.climber.robot
        names, units = robot.dof_names, robot.dof_units
        columns = {"t": ("s", "f8"), "path_time": ("s", "f8")}
        columns |= {name: (unit, "f8") for name, unit in motion_units(robot).items()}
        force = {"m": "N", "rad": "N m"}
        columns |= {
            f"u.{name}": (force[unit] if torques else f"{unit}/s", "f8")
            for name, unit in zip(names, units, strict=True)
        }
        limbs = tuple(limb.name for limb in climber.limbs)
        columns |= {f"{part}.{limb}": ("", "i8") for part in ("contact", "aim", "state") for limb in limbs}
        if torques:
            columns |= {f"wrench.{limb}.{axis}": (unit, "f8") for limb in limbs for axis, unit in WRENCH.items()}
        columns["kept"] = ("", "?")
        meta: dict[str, Any] = {
            "kind": "climb", "robot": robot.name, "climber": climber.name, "robot_digest": robot.fingerprint,
            "scene": plan.scene.name, "scene_digest": scene_digest(plan.scene), "limbs": list(limbs), "period": dt,
            "command": "torque" if torques else "velocity", "footholds": [f.id for f in plan.scene.footholds],
        }  # fmt: skip
        self._recorder, self._row = TickRecorder(columns, meta), np.zeros((1, len(columns)))
        self._ends = np.cumsum([2, robot.nq, robot.nv, robot.nv, 2 * len(limbs), len(limbs)]).tolist()
        self._scene, self._presence = plan.scene, list[tuple[int, float, bool]]()

    def add(self, times: tuple[float, float], motion: tuple[Array, Array, Array], contacts: list[int],
            states: list[int], kept: bool, wrenches: Array | None) -> None:  # fmt: skip
        """A tick: (clock, time of the plan), (q, v, command), contacts with aims, and the rest as of the class."""
        row, (a, b, c, d, e, f) = self._row[0], self._ends
        row[:a], row[a:b], row[b:c], row[c:d] = times, *motion
        row[d:e], row[e:f] = contacts, states
        if wrenches is not None:
            row[f:-1] = wrenches
        row[-1] = kept
        self._recorder.extend(self._row)
        if len(self._recorder) % CHUNK == 0:
            self._recorder.send()

    def seen(self, row: int, time: float, there: bool) -> None:
        """A foothold came or vanished at a time [s]."""
        self._presence.append((row, time, there))
        self._recorder.send({"presence": self._tables()["presence"]})

    @contextmanager
    def written(self, file: pathlib.Path) -> Iterator[None]:
        """Within it ticks are written there as well, :data:`CHUNK` at once."""
        self._recorder.write_to(FileWriter(file, overwrite=True))
        self._recorder.send(self._tables())
        try:
            yield
        finally:
            self._recorder.close()

    def log(self) -> Log:
        """All ticks, with the footholds as a table."""
        return self._recorder.log(self._tables())

    def _tables(self) -> dict[str, Array]:
        rows = [[*pin.SE3ToXYZQUAT(f.pose), f.friction] for f in self._scene.footholds]
        out = {"footholds": np.array(rows).reshape(-1, FOOTHOLD_COLUMNS)}
        if self._presence:
            out["presence"] = np.array(self._presence, dtype=float).reshape(-1, PRESENCE_COLUMNS)
        return out


def _told(shape: object) -> str:
    """A shape in words that tell it from others."""
    corners = getattr(shape, "corners", None)
    return repr(shape) if corners is None else hashlib.sha256(np.ascontiguousarray(corners).tobytes()).hexdigest()
