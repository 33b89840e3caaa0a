"""What the loop writes down of every tick, by the recorder of all logs."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene
from wbc.log import Log, TickRecorder
from wbc.multibody import pin
from wbc.validation import Array

#: Components of a wrench in the log, in the axes of the foothold
WRENCH = {"fx": "N", "fy": "N", "fz": "N", "mx": "N m", "my": "N m", "mz": "N m"}
#: Columns of a foothold in the table ``footholds``: position [m], quaternion x, y, z, w, friction
FOOTHOLD_COLUMNS = 8


def scene_digest(scene: ClimbScene) -> str:
    """Hash of footholds, bodies and gravity."""
    text = [f"{f.id} {f.on} {f.friction!r} {f.limbs}" for f in scene.footholds]
    text += [f"{name} {_told(body.shape)}" for name, body in sorted(scene.bodies.items())]
    poses = [f.pose for f in scene.footholds] + [body.placement for _, body in sorted(scene.bodies.items())]
    numbers = np.concatenate([np.ravel(pose.homogeneous) for pose in poses] + [np.ravel(scene.gravity)])
    return hashlib.sha256("\n".join(text).encode() + numbers.tobytes()).hexdigest()[:32]


class ClimbRecorder:
    """The log of a climb. A row, the first one of the start:

        t, path_time       of the plant's clock, and of the plan [s]
        q.NAME             configuration after the tick [m, rad]; v.DOF the velocity that the plant reports
        u.DOF              what was commanded: velocities [m/s, rad/s], or torques [N m]
        contact.LIMB       row in the run's scene of the foothold that it is closed on, -1 for none
        state.LIMB         a ``LimbState``
        wrench.LIMB.fx     ... mz: of a stack of torques what the contact bears, in the axes of the foothold [N, N m]
        kept               whether every row of the stack held

    Args:
        plan: what is carried out. torques: whether torques are commanded.
    """

    def __init__(self, plan: ContactPlan, torques: bool, dt: float) -> None:
        climber, robot = plan.climber, plan.climber.robot
        names, units = robot.dof_names, robot.dof_units
        columns = {"t": ("s", "f8"), "path_time": ("s", "f8")}
        columns |= {f"q.{k}": ("m, rad", "f8") for k in range(robot.nq)}
        columns |= {f"v.{name}": (f"{unit}/s", "f8") for name, unit in zip(names, units, strict=True)}
        force = {"m": "N", "rad": "N m"}
        columns |= {
            f"u.{name}": (force[unit] if torques else f"{unit}/s", "f8")
            for name, unit in zip(names, units, strict=True)
        }
        limbs = tuple(limb.name for limb in climber.limbs)
        columns |= {f"{part}.{limb}": ("", "i8") for part in ("contact", "state") for limb in limbs}
        if torques:
            columns |= {f"wrench.{limb}.{axis}": (unit, "f8") for limb in limbs for axis, unit in WRENCH.items()}
        columns["kept"] = ("", "?")
        meta: dict[str, Any] = {
            "kind": "climb", "robot": robot.name, "climber": climber.name, "robot_digest": robot.fingerprint,
            "scene": plan.scene.name, "scene_digest": scene_digest(plan.scene), "limbs": list(limbs), "period": dt,
            "command": "torque" if torques else "velocity", "footholds": [f.id for f in plan.scene.footholds],
        }  # fmt: skip
        self._recorder, self._row = TickRecorder(columns, meta), np.zeros((1, len(columns)))
        self._ends = np.cumsum([2, robot.nq, robot.nv, robot.nv, len(limbs), len(limbs)]).tolist()
        self._scene = plan.scene

    def add(self, times: tuple[float, float], motion: tuple[Array, Array, Array], contacts: list[int],
            states: list[int], kept: bool, wrenches: Array | None) -> None:  # fmt: skip
        """A tick: (clock, time of the plan), (q, v, command), and the rest as of the class."""
        row, (a, b, c, d, e, f) = self._row[0], self._ends
        row[:a], row[a:b], row[b:c], row[c:d] = times, *motion
        row[d:e], row[e:f] = contacts, states
        if wrenches is not None:
            row[f:-1] = wrenches
        row[-1] = kept
        self._recorder.extend(self._row)

    def log(self) -> Log:
        """All ticks, with the footholds as a table."""
        rows = [[*pin.SE3ToXYZQUAT(f.pose), f.friction] for f in self._scene.footholds]
        return self._recorder.log({"footholds": np.array(rows).reshape(-1, FOOTHOLD_COLUMNS)})


def _told(shape: object) -> str:
    """A shape in words that tell it from others."""
    corners = getattr(shape, "corners", None)
    return repr(shape) if corners is None else hashlib.sha256(np.ascontiguousarray(corners).tobytes()).hexdigest()
