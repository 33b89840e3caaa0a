"""Xacro files, expanded without ROS."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Mapping

from wbc import extras, validation
from wbc.errors import RobotFileError
from wbc.robot.sources.kinds import XACRO
from wbc.robot.sources.made import kept

#: Where a file names an argument
ARGUMENT = re.compile(r"""<xacro:arg\b[^>]*\bname=["'](\w+)["']|\$\(arg\s+(\w+)\s*\)""")


def expanded(path: pathlib.Path, arguments: Mapping[str, str]) -> pathlib.Path:
    """The URDF file that a xacro file expands to, in the cache; its meshes are named by whole paths.

    Packages are the folders above the file, and what lies in these, that have a ``package.xml``; files are looked for
    from the one that includes them. Expanding runs expressions that the file holds, and reads other files that it
    names: expand only what is trusted.

    Raises:
        MissingPackageError: xacrodoc is not installed. RobotFileError: it cannot be expanded, and why.
        UnknownNameError: an argument that neither the file nor what it includes names.
    """
    extras.require("xacro", "a xacro file")
    import xacro
    from xacrodoc import XacroDoc, packages

    beside = [file.parent for above in reversed(path.resolve().parents) for file in above.glob("*/package.xml")]
    try:
        packages.reset()
        packages.walk_up_from(path)
        packages.update_package_cache({folder.name: folder.as_posix() for folder in beside})
        xacro.all_includes.clear()
        plain = xacro.process_file(str(path), mappings=dict(arguments)).toxml()
        text = str(XacroDoc.from_string(plain, rootdir=path.parent).to_urdf_string(use_protocols=False))
    except Exception as error:
        reason = str(error).strip().splitlines()
        said = f"{type(error).__name__}: {reason[0] if reason else 'no reason given'}"
        raise RobotFileError("robot", str(path), f"cannot be expanded: {said}") from error
    read = (pathlib.Path(file).read_text(encoding="utf-8", errors="replace") for file in (path, *xacro.all_includes))
    named = {name for file in read for found in ARGUMENT.findall(file) for name in found if name}
    for name in arguments:
        validation.one_of("arguments", name, sorted(named))
    return kept(text, f"{path.name.removesuffix(XACRO).removesuffix('.urdf')}.urdf")
