"""Equalities of a compiled MuJoCo model that close loops of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from wbc.multibody import own
from wbc.robot.loops import AnyLoop, JointCurve, Loop
from wbc.robot.sources.mjnames import MjNames, held_bodies, pose_of
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco


def loops_of(
    model: mujoco.MjModel,
    equalities: Sequence[int],
    bodies: Sequence[int],
    joints: set[int],
    names: MjNames,
    out: own.Model,
) -> tuple[tuple[AnyLoop, ...], list[int]]:
    """(loops, with their frames added to ``out``; numbers of the equalities that close none of the robot).

    Args:
        equalities: their numbers. bodies, joints: MuJoCo's numbers of those of the robot. out: the robot's model.
    """
    import mujoco

    kinds: dict[int, Literal["connect", "weld"]] = {
        int(mujoco.mjtEq.mjEQ_CONNECT): "connect",
        int(mujoco.mjtEq.mjEQ_WELD): "weld",
    }
    loops, lost = list[AnyLoop](), list[int]()
    for k in equalities:
        kind, ends, data = int(model.eq_type[k]), (int(model.eq_obj1id[k]), int(model.eq_obj2id[k])), model.eq_data[k]
        name = str(model.eq(k).name) or f"loop{k}"
        if kind == int(mujoco.mjtEq.mjEQ_JOINT) and {j for j in ends if j >= 0} <= joints:
            loops.append(_curve(model, name, ends, data[:5].tolist(), names))
            continue
        if kind not in kinds or not {*(ours := held_bodies(model, k)), 0} <= {*bodies, 0} or ours == (0, 0):
            lost.append(k)
            continue
        sites = int(model.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE)
        if sites:
            places = [pose_of(model.site_pos[s], model.site_quat[s]) for s in ends]
        elif kinds[kind] == "connect":
            places = [_shifted(data[:3]), _shifted(data[3:6])]
        else:
            # The anchor in the second body, and the second body in the first
            places = [pose_of(data[3:6], data[6:10]), _shifted(data[:3])]
        labels = []
        for body, place, side in zip(ours, places, "ab", strict=True):
            labels.append(f"{name}:{side}")
            above = out.frames[out.getFrameId(names.bodies[body], own.FrameType.BODY)] if body else None
            joint, pose = (0, place) if above is None else (int(above.parentJoint), above.placement * place)
            out.addFrame(own.Frame(labels[-1], joint, 0, pose, own.FrameType.OP_FRAME))
        loops.append(Loop(name, labels[0], labels[1], kinds[kind]))
    return tuple(loops), lost


def _shifted(position: Array) -> own.SE3:
    return own.SE3(np.eye(3), np.array(position))


def _curve(model: mujoco.MjModel, name: str, ends: tuple[int, int], terms: list[float], names: MjNames) -> JointCurve:
    """y - y0 = a + b (x - x0) + c (x - x0)^2 + ..., or y - y0 = a."""
    follower, leader = ends
    start = [float(model.qpos0[int(model.jnt_qposadr[j])]) if j >= 0 else 0.0 for j in ends]
    if leader < 0:
        return JointCurve(name, names.joints[follower], None, (terms[0],), (start[0], 0.0))
    while len(terms) > 1 and terms[-1] == 0.0:
        terms = terms[:-1]
    return JointCurve(name, names.joints[follower], names.joints[leader], tuple(terms), (start[0], start[1]))
