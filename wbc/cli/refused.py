"""What is said of a word that a command refused: its option; of a file what it is, and which command wants it."""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from wbc.errors import WbcError

#: So much of a file says what it is [bytes]
BEGINNING = 4096
#: Names of errors about a line of a file
LINE = "line "


@dataclass(frozen=True)
class FileKind:
    """What a file can be.

    Attributes:
        name: with an article. takers: commands that want one, or other ways to use it.
        fields: of errors of commands that want one.
    """

    name: str
    takers: tuple[str, ...]
    fields: tuple[str, ...] = ()

    def wanted(self, words: Iterable[str], error: WbcError) -> bool:
        """Whether a command of these words wants one."""
        given = {"wbc", *words}
        return error.field in self.fields or any(given.issuperset(taker.split()) for taker in self.takers)


ROBOT = FileKind("a robot description", ("wbc robots show", "the ROBOT of a command"), ("robot", "what"))
TICKS = FileKind("a recording of ticks", ("wbc replay", "wbc view", "wbc convert"), ("run", "recording"))
LOG = FileKind("a log of a run", ("wbc convert", "wbc.log.load"))
MCAP = FileKind("an MCAP recording", ("Foxglove", "wbc.formats.read_motion"))
PLAN = FileKind("a plan of a walk", ("wbc walk --plan", "wbc walk compare"))
LAW = FileKind("a law of motion", ("wbc.trajectory.load",))
CLIP = FileKind("a clip of motion", ("wbc retarget",))
PAIRS = FileKind("a file of pairs of links", ("wbc robots pairs --pairs",))
STUDY = FileKind("a study", ("wbc study",))
PROGRAM = FileKind("a program of steps", ("wbc.program",))
PICTURE = FileKind("a picture", ())
PAGE = FileKind("a page", ("a browser",))
#: Files in a folder -> what it is
FOLDERS = {
    "request.json": FileKind("the folder of a walk", ("wbc walk check", "wbc walk resume", "wbc view", "wbc convert")),
    "study.json": FileKind("the folder of a study", ("wbc study --resume",)),
    "ticks.npz": FileKind("the folder of a run", TICKS.takers),
}
#: What files begin with
BEGINNINGS = (
    (b"\x89MCAP", MCAP), (b"PAR1", LOG), (b"HIERARCHY", CLIP), (b"\x89PNG", PICTURE), (b"GIF8", PICTURE),
    (b"<!DOCTYPE html", PAGE), (b"<html", PAGE), (b"PXR-USDC", ROBOT),
)  # fmt: skip
#: Members of an archive, of which the first that is there says what it is
ARCHIVES = {
    "about.json": TICKS, "timing.times.npy": LAW, "table:moves.npy": PLAN, "t.npy": LOG,
}  # fmt: skip
#: What texts hold
TEXTS = {
    r"<(robot|mujoco|sdf)[\s>]": ROBOT, "#usda": ROBOT, r"\[\[pairs\]\]": PAIRS, "scenario:": STUDY, "steps:": PROGRAM,
}  # fmt: skip
#: Columns that a table begins with
TABLES = {
    "time,pair,r1": FileKind("orders of an arm", ("wbc coordinates drive --rates",)),
    "t,vx,vy,vz": FileKind("rates of a walk", ("wbc walk drive",)),
    "t,x,y,z": FileKind("a path of waypoints", ("wbc track --path",)),
    "x,y,z": FileKind("a table of targets", ("wbc ik --targets",)),
    "id,x,y,z": FileKind("a structure to walk on", ("wbc walk --scene",)),
    "t [s]": LOG,
}


def kind_of(path: Path) -> FileKind | None:
    """What a file or folder is, by what is in it; None: nothing that is known here."""
    if path.is_dir():
        return next((kind for name, kind in FOLDERS.items() if (path / name).is_file()), None)
    try:
        with path.open("rb") as file:
            start = file.read(BEGINNING)
    except OSError:
        return None
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            return next((kind for name, kind in ARCHIVES.items() if name in archive.namelist()), None)
    for beginning, kind in BEGINNINGS:
        if start.startswith(beginning):
            return kind
    text = start.decode("utf-8", "replace").lstrip("\ufeff")
    for columns, kind in TABLES.items():
        if text.replace(", ", ",").startswith(columns):
            return kind
    return next((kind for words, kind in TEXTS.items() if re.search(f"^{words}", text, re.MULTILINE)), None)


def taken_elsewhere(error: WbcError, words: Sequence[str]) -> str:
    """What to say of the file that a command of these words refused: what it is and what takes it; empty where the
    error is about no file, or one of the kind that was wanted.
    """
    value, given = str(error.value), [word for word in words[1:] if os.path.exists(word)]
    about = [word for word in given if word == value] or [
        word
        for word in given
        if word in error.field or error.field.startswith(LINE) or (value.startswith(".") and word.endswith(value))
    ]
    kind = kind_of(Path(about[0])) if len(set(about)) == 1 else None
    if kind is None or kind.wanted(words, error):
        return ""
    return f"; {about[0]} is {kind.name}{', for ' * bool(kind.takers)}{', '.join(kind.takers)}"


def of_its_option(error: WbcError, words: Sequence[str]) -> WbcError:
    """The error of a command of these words, with the option whose value was refused, where its field is another."""
    value = str(error.value)
    options = {option for option, word in pairwise(words) if word == value and option.startswith("--")}
    named = {option for option in options if option[2:].replace("-", "_") != error.field.replace("-", "_")}
    return error.about(named.pop()) if len(options) == 1 and named else error
