"""Reading MJCF files: Pinocchio's parser for the model, the XML for joint ranges, keyframes and couplings.

Pinocchio 4.1 scales the range of a slide joint as if it were an angle, applies ranges of joints that say
``limited="false"``, and counts q from ``ref``; ranges are therefore taken from the XML here, and joints are turned so
that q counts as the file does. It loses the mass of geoms that touch nothing, see
:func:`wbc.robot.sources.mjcf_xml.with_weight`.
"""

from __future__ import annotations

import pathlib

import numpy as np
import pinocchio as pin

from wbc.errors import RobotFileError
from wbc.robot.sources.description import Description, Mimic, with_base
from wbc.robot.sources.files import PARSER_ERRORS, captured_stderr
from wbc.robot.sources.mjcf_xml import Element, MjcfJoint, joints, parser_file, read_tree, with_weight
from wbc.validation import Array

_KINDS = {"hinge": (1, 1), "slide": (1, 1), "ball": (4, 3), "free": (7, 6)}


def read_mjcf(path: pathlib.Path, base: str | None = None) -> Description:
    """The description in an MJCF file; a free joint at the root makes it floating unless ``base`` says otherwise.

    Raises:
        RobotFileError: the file cannot be read or is no MJCF; the parser's reason is in the message.
    """
    tree = read_tree(path)
    try:
        with captured_stderr() as noise, parser_file(with_weight(tree)) as file:
            model = pin.buildModelFromMJCF(file)
        listed = joints(tree)
    except PARSER_ERRORS as error:
        reason = noise.reason or " ".join(str(error).split())
        raise RobotFileError("robot", str(path), f"the MJCF parser refused it: {reason}") from error
    if not _same_order(model, listed):
        found = ", ".join(str(name) for name in list(model.names)[1:])
        raise RobotFileError("robot", str(path), f"the MJCF parser read other joints than the file has: {found}")
    notes = {"parser": noise.reason} if noise.reason else {}
    _set_ranges(model, listed)
    _count_from_zero(model, listed, path)
    states = _states(model)
    mimics, coupling_note = _couplings(tree, {joint.name: joint.ref for joint in listed})
    if coupling_note:
        notes["mimic"] = coupling_note
    drawn = np.concatenate([np.zeros(0), *states["qpos0"].values()]) if "qpos0" in states else None
    whole, kind = with_base(model, base, drawn)
    return Description(whole, kind, mimics, states, notes=notes, source=str(path))


def read_mjcf_geometry(path: pathlib.Path) -> tuple[pin.Model, pin.GeometryModel]:
    """The model of a file and its collision bodies.

    Raises:
        RobotFileError: as :func:`read_mjcf`; also a mesh that cannot be read.
    """
    tree = read_tree(path)
    try:
        with captured_stderr() as noise, parser_file(tree) as file:
            model = pin.buildModelFromMJCF(file)
            return model, pin.buildGeomFromMJCF(model, file, pin.GeometryType.COLLISION)
    except PARSER_ERRORS as error:
        reason = noise.reason or " ".join(str(error).split())
        raise RobotFileError("robot", str(path), f"the bodies of the MJCF file cannot be read: {reason}") from error


def _parts(model: pin.Model) -> list[tuple[str, pin.JointModel]]:
    """(name, joint) of the model's joints in the order of q, composites taken apart."""
    parts = []
    for j in range(1, model.njoints):
        joint = model.joints[j]
        if joint.shortname() == "JointModelComposite":
            parts += [("", part) for part in joint.extract().joints]
        else:
            parts.append((str(model.names[j]), joint))
    return parts


def _same_order(model: pin.Model, listed: list[MjcfJoint]) -> bool:
    """Whether the model has the file's joints in the file's order, judged by sizes, slides and names."""
    parts = _parts(model)
    if len(parts) != len(listed):
        return False
    for (name, part), joint in zip(parts, listed, strict=True):
        slides = part.shortname().startswith("JointModelP") and part.nq == 1
        if (part.nq, part.nv) != _KINDS.get(joint.kind) or slides != (joint.kind == "slide"):
            return False
        if name and joint.name and name != joint.name:
            return False
    return True


def _set_ranges(model: pin.Model, listed: list[MjcfJoint]) -> None:
    """Writes the file's ranges into the model."""
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    index = 0
    for joint in listed:
        width = _KINDS[joint.kind][0]
        lower[index : index + width], upper[index : index + width] = joint.lower, joint.upper
        index += width
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper


def _count_from_zero(model: pin.Model, listed: list[MjcfJoint], path: pathlib.Path) -> None:
    """Turns or moves joints back by ``ref``, where the file draws them, so that q is the file's qpos.

    Raises:
        RobotFileError: a joint with ``ref`` among several of one body, which Pinocchio makes one joint of.
    """
    for joint in listed:
        if not joint.ref:
            continue
        if not model.existJointName(joint.name):
            reason = f"ref of {joint.name or 'a joint'!r}, one of several joints of a body: pip install wbc[mujoco]"
            raise RobotFileError("robot", str(path), reason)
        j = model.getJointId(joint.name)
        part = model.joints[j].createData()
        model.joints[j].calc(part, np.concatenate([np.zeros(model.idx_qs[j]), [-joint.ref], np.zeros(model.nq)]))
        model.jointPlacements[j] = model.jointPlacements[j] * part.M


def _states(model: pin.Model) -> dict[str, dict[str, Array]]:
    """The keyframes, by joint; ``qpos0`` is the pose that the file is drawn in."""
    states = {}
    for entry in model.referenceConfigurations:
        q = np.array(entry.data())
        states[str(entry.key())] = {
            str(model.names[j]): q[model.idx_qs[j] : model.idx_qs[j] + model.nqs[j]] for j in range(1, model.njoints)
        }
    return states


def _couplings(tree: Element, refs: dict[str, float]) -> tuple[tuple[Mimic, ...], str]:
    """Linear joint equalities, and a sentence about the equalities that are none."""
    mimics, lost = [], []
    for equality in tree.findall("equality"):
        for element in equality:
            terms = [float(x) for x in element.get("polycoef", "0 1 0 0 0").split()]
            if element.tag == "joint" and element.get("joint2") and not any(terms[2:]):
                offset, ratio = (terms + [0.0, 0.0])[:2]
                first, second = element.get("joint1", ""), element.get("joint2", "")
                # y - y0 = a + b (x - x0)
                mimics.append(
                    Mimic(first, second, ratio, offset + refs.get(first, 0.0) - ratio * refs.get(second, 0.0))
                )
            else:
                lost.append(f"<{element.tag} {element.get('name', '')}>".replace(" >", ">"))
    return tuple(mimics), f"equalities that are not represented: {', '.join(lost)}" if lost else ""
