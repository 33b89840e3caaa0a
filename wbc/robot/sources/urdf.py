"""Reading URDF files: what they say besides the model, and what of it is taken otherwise than written."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import numpy as np

from wbc.errors import RangeError, RobotFileError
from wbc.multibody import own
from wbc.robot.sources.description import Description, Mimic, moving_freely, root_joint, with_base
from wbc.robot.sources.urdf_checks import SINGLE, Remarks, axis_of, check_elements, check_links, check_tree, number
from wbc.robot.sources.urdf_model import NotUrdf, UrdfElements, build_model
from wbc.validation import Array

Joints = Mapping[str, ElementTree.Element]


def read_urdf(
    path: pathlib.Path,
    tree: ElementTree.Element,
    base: str | None = None,
    mimic_leaders: Mapping[str, str] | None = None,
) -> Description:
    """The description in a URDF file, on the given base (default: its own, else fixed).

    A floating or planar joint that alone carries all else is the base; another one is ``undriven``. What the file says
    and the description does not hold is said in the log and in the notes.

    Args:
        path: the file. tree: what is in it.
        base: ``fixed``, ``floating``, ``planar`` or ``differential``.
        mimic_leaders: follower -> leader, for files that misspell the leader of a mimic joint.

    Raises:
        RobotFileError: what is no URDF; no tree, a joint without an axis, a negative mass,
            by names and numbers; a ``base`` that contradicts the file's own.
        RangeError: a mimic of a joint with several numbers.
    """
    remarks, joints = Remarks(path), {str(joint.get("name")): joint for joint in tree.findall("joint")}
    leaders = _leaders(joints, dict(mimic_leaders or {}))
    coupled = {name for pair in leaders.items() if pair[1] in joints for name in pair}
    unlimited = _read_limits(joints, coupled, remarks)
    check_tree(path, tree)
    loose = any(joint.get("type") in ("floating", "planar") for joint in joints.values())
    try:
        elements = UrdfElements(tree, remarks)
        model = build_model(elements, None if loose or base is None else root_joint(base))
    except NotUrdf as error:
        raise RobotFileError("robot", str(path), f"it is no URDF: {error.reason}") from error
    check_links(path, tree, remarks)
    check_elements(tree, remarks)
    mimics = _mimics(joints, leaders, model, remarks)
    accelerations = _accelerations(joints, remarks)
    for name in unlimited:
        index = int(model.idx_qs[model.getJointId(name)])
        for bound, none in (("lowerPositionLimit", -np.inf), ("upperPositionLimit", np.inf)):
            values = np.array(getattr(model, bound))
            values[index] = none
            setattr(model, bound, values)
    for name, joint in joints.items():
        if joint.get("type") == "planar":
            if joint.find("axis") is None:
                remarks.add("plane", f"{name} has no axis: its plane is normal to x, as the format says")
            _turn_plane(model, model.getJointId(name), axis_of(joint))
    whole, kind = with_base(model, base)
    beyond = range(1 if kind == "fixed" else 2, whole.njoints)
    undriven = tuple(str(whole.names[j]) for j in beyond if moving_freely(whole, j) != "fixed")
    moved = tuple(str(joint.get("name")) for one in tree.findall("transmission") for joint in one.findall("joint"))
    return Description(
        whole,
        kind,
        mimics,
        acceleration=accelerations,
        notes=remarks.said(),
        source=str(path),
        undriven=undriven,
        geometry=tree,
        transmissions=moved,
    )


def _leaders(joints: Joints, corrections: dict[str, str]) -> dict[str, str]:
    """Follower -> leader, of the joints that move."""
    return {
        name: corrections.get(name, str(mimic.get("joint")))
        for name, joint in joints.items()
        if (mimic := joint.find("mimic")) is not None and joint.get("type") != "fixed"
    }


def _accelerations(joints: Joints, remarks: Remarks) -> dict[str, float]:
    """Limits of acceleration and deceleration, of which the lesser counts, of joints with one coordinate (URDF 1.2)."""
    out, jerks = dict[str, float](), list[str]()
    for name, joint in joints.items():
        limit = joint.find("limit")
        if limit is None or joint.get("type") not in SINGLE:
            continue
        given = [number(limit, key, np.nan) for key in ("acceleration", "deceleration") if limit.get(key) is not None]
        if any(not 0.0 < value < np.inf for value in given):
            remarks.add("acceleration limits", f"an acceleration of {name} is not above 0: unlimited")
        elif given:
            out[name] = min(given)
        if limit.get("jerk") is not None:
            jerks.append(name)
    if jerks:
        remarks.add("jerk", f"limits of jerk are not held: {', '.join(jerks)}")
    return out


def _mimics(joints: Joints, leaders: dict[str, str], model: own.Model, remarks: Remarks) -> tuple[Mimic, ...]:
    """The mimic joints; one whose leader the file does not have stays free, one whose leader is fixed stands still."""
    found, lost = [], []
    for follower, leader in leaders.items():
        if leader not in joints:
            lost.append(f"{follower} (of {leader})")
            continue
        for name in (follower, leader):
            if joints[name].get("type") not in (*SINGLE, "fixed"):
                raise RangeError("mimic", name, "only joints with one coordinate can be coupled")
        mimic = joints[follower].find("mimic")
        assert mimic is not None
        found.append(Mimic(follower, leader, number(mimic, "multiplier", 1.0), number(mimic, "offset")))
        if not model.existJointName(leader):
            remarks.add("mimic", f"{follower} follows {leader}, which is fixed: it stands at {found[-1].offset:g}")
    if lost:
        remarks.add("mimic", f"the file has no such leader, so these stay free: {', '.join(lost)}")
    return tuple(found)


def _read_limits(joints: Joints, coupled: set[str], remarks: Remarks) -> list[str]:
    """Puts limits into a form that the parser takes; names of the revolute and prismatic joints without a range.

    A continuous joint that others follow, or that follows, becomes a revolute one without a range: it turns by an angle
    that has a ratio to others, which a point on a circle has not.
    """
    unlimited, absent = [], []
    for name, joint in joints.items():
        kind, limit = joint.get("type"), joint.find("limit")
        if kind == "continuous" and name in coupled:
            joint.set("type", "revolute")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
        if kind not in SINGLE or limit is None:
            continue
        for key, unit in (("effort", "N m or N"), ("velocity", "rad/s or m/s")):
            if number(limit, key) < 0.0:
                remarks.add(key, f"{key} of {name} is {limit.get(key)} {unit}, below 0: unlimited")
                limit.set(key, "0")
        lower, upper = number(limit, "lower"), number(limit, "upper")
        if kind == "continuous":
            if lower < upper:
                remarks.add("position", f"{name} is continuous: its lower {lower:g} and upper {upper:g} limit nothing")
        elif lower > upper:
            remarks.add("position", f"lower {lower:g} of {name} is above its upper {upper:g}: unlimited")
        elif limit.get("lower") is None and limit.get("upper") is None:
            absent.append(name)
        else:
            continue
        if joint.get("type") != "continuous":
            limit.attrib.pop("lower", None), limit.attrib.pop("upper", None)
            unlimited.append(name)
    if absent:
        remarks.add(
            "position", f"the file gives neither lower nor upper for {', '.join(absent)}: unlimited", loud=False
        )
    return unlimited


def _turn_plane(model: own.Model, j: int, axis: Array) -> None:
    """Turns the plane of a planar joint, which Pinocchio has normal to z, so that it is normal to an axis.

    The joint's pose is  origin R M(x, y, angle) R'  with R the least turn that takes z to the axis.
    """
    axis = axis / np.linalg.norm(axis)
    half = np.array([0.0, 0.0, 1.0]) + axis
    # 2 h h' / h'h - 1 turns by pi about h, which lies halfway; before it half a turn about z
    turn = np.diag([1.0, -1.0, -1.0])
    if half @ half > 1e-12:
        turn = (2.0 * np.outer(half, half) / (half @ half) - np.eye(3)) @ np.diag([-1.0, -1.0, 1.0])
    there = own.SE3(turn, np.zeros(3))
    back = there.inverse()
    model.jointPlacements[j] = model.jointPlacements[j] * there
    model.inertias[j] = back.act(model.inertias[j])
    for k in range(1, model.njoints):
        if model.parents[k] == j:
            model.jointPlacements[k] = back * model.jointPlacements[k]
    for frame in model.frames:
        if frame.parentJoint == j:
            frame.placement = back * frame.placement
