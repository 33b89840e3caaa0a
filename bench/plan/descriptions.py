"""A problem as URDF and SRDF, with the bodies and pairs that this package has, for planners that read these."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from wbc.plan.coordinates import PlanningCoordinates
from wbc.shapes import Capsule, Sphere

_JOINTS = {"rad": "revolute", "m": "prismatic"}


def urdf(coordinates: PlanningCoordinates, limits: Any, boxes: Any) -> tuple[str, list[str], list[str]]:
    """(text, names of the links with shapes, names of the boxes)."""
    robot, model = coordinates.robot, coordinates.robot.model
    out = ['<robot name="robot"><link name="l0"/>']
    low, high = limits
    for at, joint in enumerate(range(1, model.njoints)):
        axis = _axis(model, joint)
        kind = _JOINTS[coordinates.units[at]]
        origin = _origin(model.jointPlacements[joint])
        # A joint without end turns as far as the planner looks
        out.append(
            f'<link name="l{joint}"/><joint name="{coordinates.names[at]}" type="{kind}">'
            f'<parent link="l{model.parents[joint]}"/>'
            f'<child link="l{joint}"/>{origin}<axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
            f'<limit lower="{low[at]!r}" upper="{high[at]!r}" effort="1" velocity="1"/></joint>'
        )
    shaped = []
    for link, shapes in robot.shapes.items():
        frame = model.frames[model.getFrameId(link)]
        if not shapes or not frame.parentJoint:
            continue
        shaped.append(link)
        bodies, capsules = "", ""
        for k, placed in enumerate(shapes):
            pose = frame.placement * placed.placement * pin.SE3(np.eye(3), placed.shape.center)
            geometry = _geometry(placed.shape)
            bodies += f'<collision name="{link}_{k}">{_origin(pose)}<geometry>{geometry}</geometry></collision>'
            if isinstance(placed.shape, Capsule):
                capsules += f'<capsule name="{link}_{k}"/>'
        out.append(f'<link name="{link}">{bodies}<collision_checking>{capsules}</collision_checking></link>')
        out.append(_fixed(link, f"l{frame.parentJoint}"))
    names = []
    for k, (sides, place, turn) in enumerate(boxes):
        names.append(f"box{k}")
        pose = pin.SE3(pin.exp3(np.array([0.0, 0.0, turn])), np.array(place))
        body = f'<geometry><box size="{sides[0]!r} {sides[1]!r} {sides[2]!r}"/></geometry>'
        out.append(f'<link name="box{k}"><collision>{_origin(pose)}{body}</collision></link>{_fixed(f"box{k}", "l0")}')
    return "".join([*out, "</robot>"]), shaped, names


def srdf(pairs: set[frozenset[str]], links: list[str], boxes: list[str], joints: tuple[str, ...]) -> str:
    """One group of all joints; of two links only ``pairs`` may not touch, and no link a box."""
    group = "".join(f'<joint name="{name}"/>' for name in joints)
    off = [
        f'<disable_collisions link1="{a}" link2="{b}" reason="User"/>'
        for k, a in enumerate(links)
        for b in links[k + 1 :]
        if frozenset((a, b)) not in pairs
    ]
    off += [
        f'<disable_collisions link1="{a}" link2="{b}" reason="User"/>'
        for k, a in enumerate(boxes)
        for b in boxes[k + 1 :]
    ]
    return f'<robot name="robot"><group name="arm">{group}</group>{"".join(off)}</robot>'


def _axis(model: Any, joint: int) -> Any:
    from wbc.symbolic.joint_steps import joint_steps

    return [float(x) for x in joint_steps(model, joint)[0].numbers[:3]]


def _fixed(child: str, parent: str) -> str:
    return f'<joint name="{child}_fixed" type="fixed"><parent link="{parent}"/><child link="{child}"/></joint>'


def _origin(pose: Any) -> str:
    rpy, at = pin.rpy.matrixToRpy(pose.rotation), pose.translation
    return '<origin xyz="{!r} {!r} {!r}" rpy="{!r} {!r} {!r}"/>'.format(*map(float, (*at, *rpy)))


def _geometry(shape: Any) -> str:
    if isinstance(shape, Capsule):
        return f'<cylinder radius="{shape.radius!r}" length="{shape.length!r}"/>'
    assert isinstance(shape, Sphere)
    return f'<sphere radius="{shape.radius!r}"/>'
