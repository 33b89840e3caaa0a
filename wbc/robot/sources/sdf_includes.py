"""Models that an SDF file includes, put in the place of its ``<include>`` elements."""

from __future__ import annotations

import copy
import pathlib
import re
import xml.etree.ElementTree as ElementTree

from wbc.errors import RobotFileError
from wbc.robot.sources.files import read_xml
from wbc.robot.sources.sdf_frames import Refused

#: What a URI may begin with; what follows is looked for beside the file, then beside the folders above it
_SCHEME = re.compile("(model|package|file)://")
#: What a folder of a model names its file in
_CONFIG = "model.config"
#: and what this is called where nothing names it
_UNNAMED = "model.sdf"
#: What an ``<include>`` says of the model in its own words; all else is said not to be read
_OWN = ("uri", "name", "plugin", "placement_frame")
#: What it says in the place of the model
_INSTEAD = ("pose", "static")


def with_includes(model: ElementTree.Element, file: pathlib.Path, refused: Refused) -> None:
    """Put the models that a model of a file includes, and those that these include, in their places; their names,
    poses and placement frames are those of the ``<include>``, where it has them.

    Raises:
        RobotFileError: made by ``refused``: an ``<include>`` that is merged, names no file that is there, or one that
            includes itself or has no or several models; as :func:`~wbc.robot.sources.files.read_xml` of that file.
    """
    _follow(model, (file.resolve(),), refused)


def included(include: ElementTree.Element, file: pathlib.Path, refused: Refused) -> ElementTree.Element:
    """The model that an ``<include>`` of a file means, with what that one includes; raises as :func:`with_includes`."""
    return _included(include, (file.resolve(),), refused)


def found(uri: str, file: pathlib.Path) -> pathlib.Path | None:
    """The file that a URI in a file means; None: there is none."""
    name = _SCHEME.sub("", uri, count=1)
    place = next((folder / name for folder in file.resolve().parents if name and (folder / name).exists()), None)
    if place is None or not place.is_dir():
        return place
    config = place / _CONFIG
    named = read_xml(config)[1].findall("sdf") if config.is_file() else []
    newest = max(named, key=lambda one: version_of(one.get("version", "")), default=None)
    inside = place / (_UNNAMED if newest is None else (newest.text or "").strip())
    return inside if inside.is_file() else None


def _follow(model: ElementTree.Element, way: tuple[pathlib.Path, ...], refused: Refused) -> None:
    for k, element in enumerate(model):
        if element.tag == "include":
            model[k] = _included(element, way, refused)
        elif element.tag == "model":
            _follow(element, way, refused)


def _included(include: ElementTree.Element, way: tuple[pathlib.Path, ...], refused: Refused) -> ElementTree.Element:
    uri = (include.findtext("uri") or "").strip()
    if include.get("merge", "false") in ("true", "1"):
        reason = "is merged, which is not read: without merge it is a model in the model"
        raise refused(f"the <include> of {uri!r} {reason}")
    file = found(uri, way[-1])
    if file is None:
        raise refused(
            f"the <include> of {uri!r} leads nowhere: there is no such file beside {way[-1].name} or above it"
        )
    if file.resolve() in way:
        raise refused(f"{file.name} includes itself, by {', '.join(one.name for one in way)}")
    tree = read_xml(file)[1]
    models = tree.findall("model") if tree.tag == "sdf" else []
    if len(models) != 1:
        what = f"{len(models)} models" if tree.tag == "sdf" else f"a <{tree.tag}>"
        raise refused(f"the <include> of {uri!r} is of {what}, expected an SDF file of one model")
    model = copy.deepcopy(models[0])
    _follow(model, (*way, file.resolve()), lambda reason: RobotFileError("robot", str(file), reason))
    _with_axes(model, tree.get("version", ""))
    if name := (include.findtext("name") or "").strip():
        model.set("name", name)
    if frame := (include.findtext("placement_frame") or "").strip():
        if include.find("pose") is None:
            raise refused(f"the <include> of {uri!r} has a <placement_frame>, but no <pose> of it")
        model.set("placement_frame", frame)
    for said in include:
        if said.tag in _INSTEAD and (before := model.find(said.tag)) is not None:
            model.remove(before)
        if said.tag not in _OWN:
            model.append(said)
    return model


def _with_axes(model: ElementTree.Element, version: str) -> None:
    """Say of every axis in what it is stated, as the version of its own file has it."""
    for axis in model.iter("axis"):
        if axis.find("use_parent_model_frame") is None:
            ElementTree.SubElement(axis, "use_parent_model_frame").text = str(axes_in_model(version)).lower()


def version_of(text: str) -> list[int]:
    """The first two numbers of a version of the format; of none one that states axes in joints."""
    return [int(x) for x in (text or "1.6").split(".")[:2] if x.isdigit()]


def axes_in_model(version: str) -> bool:
    """Whether axes of joints are stated in the model where nothing is said, as before SDF 1.5."""
    return version_of(version) < [1, 5]
