"""Reading URDF files: Pinocchio's parser for the model, the XML for what the parser drops."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from wbc.errors import RobotFileError
from wbc.robot.sources.description import Description, Mimic, root_joint
from wbc.robot.sources.files import PARSER_ERRORS, captured_stderr, read_xml


def read_urdf(
    path: pathlib.Path, base: str | None = None, mimic_leaders: Mapping[str, str] | None = None
) -> Description:
    """The description in a URDF file, on the given base (default: fixed).

    Args:
        path: the file.
        base: ``fixed``, ``floating``, ``planar`` or ``differential``.
        mimic_leaders: follower -> leader, for files that misspell the leader of a mimic joint.

    Raises:
        RobotFileError: the file cannot be read or is no URDF; the parser's reason is in the message.
    """
    _, tree = read_xml(path)
    if tree.tag != "robot":
        raise RobotFileError("robot", str(path), f"no URDF: the root element is <{tree.tag}>, expected <robot>")
    base = base or "fixed"
    joint = root_joint(base)
    try:
        with captured_stderr() as noise:
            model = pin.buildModelFromUrdf(str(path), *(() if joint is None else (joint,)))
    except PARSER_ERRORS as error:
        reason = noise.reason or " ".join(str(error).split())
        raise RobotFileError("robot", str(path), f"the URDF parser refused it: {reason}") from error
    notes = {"parser": noise.reason} if noise.reason else {}
    unlimited = _lift_absent_limits(model, tree)
    if unlimited:
        notes["position"] = f"the file gives neither lower nor upper for {', '.join(unlimited)}: unlimited"
    mimics, problems = _mimics(tree, dict(mimic_leaders or {}))
    if problems:
        notes["mimic"] = problems
    return Description(model, base, mimics, notes=notes, source=str(path))


def _lift_absent_limits(model: pin.Model, tree: ElementTree.Element) -> list[str]:
    """Sets joints whose <limit> has neither ``lower`` nor ``upper`` to unlimited (the parser reads 0 and 0)."""
    names = []
    for joint in tree.findall("joint"):
        name, limit = str(joint.get("name")), joint.find("limit")
        if joint.get("type") not in ("revolute", "prismatic") or not model.existJointName(name):
            continue
        if limit is None or (limit.get("lower") is None and limit.get("upper") is None):
            index = int(model.idx_qs[model.getJointId(name)])
            lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
            lower[index], upper[index] = -np.inf, np.inf
            model.lowerPositionLimit, model.upperPositionLimit = lower, upper
            names.append(name)
    return names


def _mimics(tree: ElementTree.Element, leaders: dict[str, str]) -> tuple[tuple[Mimic, ...], str]:
    """The mimic joints, and a sentence about those whose leader the file does not have."""
    joints = {str(j.get("name")) for j in tree.findall("joint")}
    found: list[Mimic] = []
    lost: list[str] = []
    for joint in tree.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None:
            continue
        follower = str(joint.get("name"))
        leader = leaders.get(follower, str(mimic.get("joint")))
        if leader not in joints:
            lost.append(f"{follower} (of {leader})")
            continue
        ratio, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        found.append(Mimic(follower, leader, ratio, offset))
    text = f"the file has no such leader, so these stay free: {', '.join(lost)}" if lost else ""
    return tuple(found), text
