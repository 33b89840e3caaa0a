"""What the shell completes: robots by name, files beside them, and frames of the robot that was typed.

Names are read from the table's TOML files; a robot is loaded for its frames alone.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: Ends of files that a robot, a path or a recording may be
ROBOT_FILES = (".urdf", ".xml", ".mjcf")


def robots(incomplete: str) -> list[str]:
    """Robots of the table and files of robots that begin so; folders end with a slash."""
    return [name for name in _table() if name.startswith(incomplete)] + list(_files(incomplete, ROBOT_FILES))


def frames(ctx: Any, incomplete: str) -> list[str]:
    """Frames of the robot that stands before on the line; none where there is no such robot."""
    from wbc.errors import WbcError
    from wbc.robots import load

    name = ctx.params.get("robot") or "panda"
    try:
        return [frame for frame in load(name, shapes="none").frame_names if frame.startswith(incomplete)]
    except WbcError:
        return []


def _table() -> list[str]:
    import wbc.robots

    folder = Path(str(wbc.robots.__file__)).parent
    names = {"walker", "two_ended_arm"}
    for file in sorted(folder.glob("*.toml")):
        rows = tomllib.loads(file.read_text(encoding="utf-8"))
        names |= {name for name, row in rows.items() if not row.get("problem")}
    arms = tomllib.loads((folder / "data" / "operator_arms.toml").read_text(encoding="utf-8"))
    return sorted(names | set(arms))


def _files(incomplete: str, ends: tuple[str, ...]) -> Iterator[str]:
    folder = Path(incomplete).parent if not incomplete.endswith("/") else Path(incomplete)
    try:
        found = sorted(folder.iterdir())
    except OSError:
        return
    for path in found:
        text = str(path) + ("/" if path.is_dir() else "")
        shown = not path.name.startswith(".") and (path.is_dir() or path.suffix.lower() in ends)
        if shown and text.startswith(incomplete):
            yield text
