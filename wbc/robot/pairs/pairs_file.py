"""The file of a robot's pairs: TOML, one pair a line, made to be edited.

    robot = "panda"
    samples = 10000                    with seed and clearance [m]: what the pairs were found with; may be left out
    pairs = [
      { links = ["panda_link0", "panda_link5"], keep = true, reason = "touches", distance = -0.1497 },
      { links = ["panda_link0", "panda_link1"], keep = false },
    ]

``links`` and ``keep`` must be there. ``reason`` is one of :data:`~wbc.robot.pairs.collision_pairs.REASONS`, and without
one, ``hand``; ``distance`` [m] and ``detail`` (the SRDF file's reason) are for the reader.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from wbc import validation
from wbc.errors import DuplicateNameError, RobotFileError, ShapeError
from wbc.robot.pairs.collision_pairs import REASONS, LinkPair, SelfPairs
from wbc.robot.pairs.link_pairs import link_pairs, shaped_links
from wbc.robot.robot import Robot

_HEAD = ("robot", "samples", "seed", "clearance", "pairs")
_FIELDS = ("links", "keep", "reason", "distance", "detail")
#: Texts in quotes within a line
_NAMES = re.compile(r""""([^"]*)"|'([^']*)'""")


def save_self_pairs(found: SelfPairs, path: Any) -> None:
    """Writes pairs to a file that :func:`read_self_pairs` reads; distances are rounded to 0.1 mm.

    Raises:
        RobotFileError: the file cannot be written.
    """
    validation.instance("found", found, SelfPairs, "what find_self_pairs gives")
    file = validation.file_path("path", path)
    lines = [
        "# Pairs of links: those with keep = true must not touch each other. Reasons:",
        *(f"#   {reason}: {meaning}" for reason, meaning in REASONS.items() if reason in found.counts()),
        f"robot = {_quoted(found.robot)}",
        f"samples = {found.samples}",
        f"seed = {found.seed}",
        f"clearance = {found.clearance!r}",
        "pairs = [",
        *(f"  {{ {_fields(pair)} }}," for pair in found.pairs),
        "]",
    ]
    with validation.writing("pairs", file, RobotFileError):
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_self_pairs(path: Any, robot: Robot) -> SelfPairs:
    """The pairs in a file, in the robot's order; pairs of links with shapes that the file does not name follow, as
    ``unlisted`` and not kept.

    Raises:
        RobotFileError: the file cannot be read or is no TOML (with its line).
        UnknownNameError: a field, reason or link that does not exist, nearest names first.
        DuplicateNameError: a pair that stands there twice, in either order, or a link with itself.
        ShapeError, RangeError, NotFiniteError: a bad value. All name the file, the line and the field.
    """
    file = validation.file_path("path", path)
    validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load")
    try:
        text = file.read_text(encoding="utf-8")
        tree = tomllib.loads(text)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RobotFileError("pairs", str(file), f"cannot be read: {error}") from error
    for key in tree:
        validation.one_of(f"{file.name}", key, _HEAD)
    rows = tree.get("pairs")
    if not isinstance(rows, list):
        raise ShapeError(f"{file.name} pairs", rows, "expected a list of pairs")
    named: dict[frozenset[str], LinkPair] = {}
    names = [{a or b for a, b in _NAMES.findall(line)} for line in text.splitlines()]
    for k, row in enumerate(rows):
        where = f"{file.name}{_line(names, row)} pairs[{k}]"
        pair = _read_pair(where, row, robot)
        if frozenset(pair.links) in named:
            raise DuplicateNameError(f"{where} links", pair.links, "this pair stands in the file already")
        named[frozenset(pair.links)] = pair
    ordered = [
        named.get(frozenset(links)) or LinkPair(links, keep=False, reason="unlisted") for links in link_pairs(robot)
    ]
    return SelfPairs(robot.name, tuple(ordered), **_read_head(file.name, tree))


def _read_head(where: str, tree: Mapping[str, Any]) -> dict[str, Any]:
    """What the pairs were found with."""
    if not isinstance(tree.get("robot", ""), str):
        raise ShapeError(f"{where} robot", tree["robot"], "expected a name")
    out: dict[str, Any] = {}
    for key in ("samples", "seed"):
        out[key] = validation.integer(f"{where} {key}", tree.get(key, 0))
    out["clearance"] = validation.scalar(f"{where} clearance", tree.get("clearance", 0.0), unit="m")
    return out


def _read_pair(where: str, row: Any, robot: Robot) -> LinkPair:
    if not isinstance(row, Mapping):
        raise ShapeError(where, row, "expected { links = [...], keep = ... }")
    for key in row:
        validation.one_of(where, key, _FIELDS)
    links = row.get("links")
    if not isinstance(links, list) or len(links) != 2:
        raise ShapeError(f"{where} links", links, "expected the names of two links")
    for link in links:
        validation.one_of(f"{where} links", link, shaped_links(robot))
    if links[0] == links[1]:
        raise DuplicateNameError(f"{where} links", links[0], "a link with itself is no pair")
    if not isinstance(row.get("keep"), bool):
        raise ShapeError(f"{where} keep", row.get("keep"), "expected true or false")
    reason = validation.one_of(f"{where} reason", row.get("reason", "hand"), REASONS)
    distance = row.get("distance")
    if distance is not None:
        distance = validation.scalar(f"{where} distance", distance, unit="m")
    detail = row.get("detail", "")
    if not isinstance(detail, str):
        raise ShapeError(f"{where} detail", detail, "expected a text")
    return LinkPair((links[0], links[1]), row["keep"], reason, distance, detail)


def _line(names: list[set[str]], row: Any) -> str:
    """Where a pair stands in the text: the first line whose quoted names have both of its links. A parsed file has no
    lines any more.
    """
    links = row.get("links") if isinstance(row, Mapping) else None
    if not isinstance(links, list) or not links or not all(isinstance(link, str) for link in links):
        return ""
    return next((f" line {number}" for number, named in enumerate(names, start=1) if named.issuperset(links)), "")


def _fields(pair: LinkPair) -> str:
    first, second = (_quoted(link) for link in pair.links)
    out = [f"links = [{first}, {second}]", f"keep = {str(pair.keep).lower()}", f"reason = {_quoted(pair.reason)}"]
    if pair.distance is not None:
        out.append(f"distance = {pair.distance:.4f}")
    if pair.detail:
        out.append(f"detail = {_quoted(pair.detail)}")
    return ", ".join(out)


def _quoted(text: str) -> str:
    """A TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
