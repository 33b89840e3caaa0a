"""Xacro files, expanded without ROS."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping

from wbc import extras
from wbc.errors import RobotFileError
from wbc.robot.sources.kinds import XACRO
from wbc.robot.sources.made import kept


def expanded(path: pathlib.Path, arguments: Mapping[str, str]) -> pathlib.Path:
    """The URDF file that a xacro file expands to, in the cache; its meshes are named by whole paths.

    Packages are looked for in the folders above the file. Expanding runs expressions that the file holds, and reads
    other files that it names: expand only what is trusted.

    Raises:
        MissingPackageError: xacrodoc is not installed. RobotFileError: it cannot be expanded, and why.
    """
    extras.require("xacro", "a xacro file")
    from xacrodoc import XacroDoc

    try:
        text = str(XacroDoc.from_file(path, subargs=dict(arguments)).to_urdf_string(use_protocols=False))
    except Exception as error:
        reason = str(error).strip().splitlines()
        said = f"{type(error).__name__}: {reason[0] if reason else 'no reason given'}"
        raise RobotFileError("robot", str(path), f"cannot be expanded: {said}") from error
    return kept(text, f"{path.name.removesuffix(XACRO).removesuffix('.urdf')}.urdf")
