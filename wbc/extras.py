"""Packages that only parts of this one need: each is installed with an extra, and a part without it says so."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable

from wbc.errors import WbcError

#: Extra of pyproject.toml -> modules that it brings
EXTRAS = {
    "analysis": ("flint",),
    "clips": ("ezc3d",),
    "cluster": ("distributed",),
    "formats": ("mcap", "msgspec", "rosbags"),
    "foxglove": ("foxglove",),
    "gymnasium": ("gymnasium",),
    "laws": ("ruckig", "toppra"),
    "mujoco": ("mujoco",),
    "osqp": ("osqp",),
    "plots": ("matplotlib",),
    "programs": ("py_trees", "pydantic", "yaml"),
    "protobuf": ("mcap_protobuf",),
    "recordings": ("pyarrow",),
    "rerun": ("rerun",),
    "ros2": ("cyclonedds", "rosbags"),
    "studies": ("pydantic", "yaml"),
    "torch": ("torch",),
    "usd": ("pxr",),
    "viewer": ("viser", "websockets"),
    "xacro": ("xacrodoc",),
    "zeromq": ("zmq",),
}


class MissingPackageError(WbcError, ModuleNotFoundError):
    """What was asked for needs a package that is not installed; the text has the command that installs it."""


def require(extra: str, what: str, module: str = "") -> None:
    """Pass where the packages of an extra are installed.

    Args:
        what: needs them, in the words of the text: "exact rank analysis".
        module: the one of them that it needs; default: all.

    Raises:
        MissingPackageError: the first that is not.
    """
    for name in (module,) if module else EXTRAS[extra]:
        if sys.modules.get(name) is None and importlib.util.find_spec(name) is None:
            reason = f"{what} needs this package: pip install 'wbc[{extra}]'"
            raise MissingPackageError(extra, name, reason)


def missing(module: str, package: str, what: str) -> MissingPackageError:
    """The error for a package that is installed by itself where there is a wheel of it.

    Args:
        module: what is imported. package: its name on the package index. what: needs it, in the words of the text.
    """
    reason = f"{what} needs this package: pip install {package}"
    if sys.platform == "win32":
        reason += " (there is no wheel of it for Windows)"
    return MissingPackageError(module, package, reason)


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Package -> its version, or ``"not installed"``."""
    from importlib import metadata  # it imports the parsers of mail

    out = {}
    for name in packages:
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out
