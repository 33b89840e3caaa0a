"""What names of joints and markers say: sides, heads, hips, feet and toes."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

#: A name's parts: LeftUpLeg -> Left Up Leg, l_hip -> l hip, LANK -> LANK
NAME_PARTS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
#: Words of a side
SIDES = {"left": "left", "l": "left", "lft": "left", "right": "right", "r": "right", "rgt": "right"}
#: Words of parts of a body, by part
WORDS = {
    "head": {"head", "neck", "nose", "skull", "hed", "hd"},
    "hip": {"hip", "upleg", "thigh", "upperleg", "femur", "asi", "psi"},
    "foot": {"foot", "ankle", "toe", "toebase", "heel", "ank", "hee", "mt5", "mt2"},
    "toe": {"toe", "toebase", "ball", "mt5", "mt2"},
    "ankle": {"ankle", "ank", "heel", "hee", "foot"},
}


def words_of(name: str) -> list[str]:
    """The words of a name in small letters; what stands before a colon is the subject's, and left out."""
    return [part.lower() for part in NAME_PARTS.findall(name.rpartition(":")[2])]


def side(name: str) -> str:
    """``"left"``, ``"right"`` or ``""``."""
    words = words_of(name)
    for word in words:
        if word in SIDES:
            return SIDES[word]
    # Markers in capitals, as LANK and RTOE
    if len(words) <= 2 and words and len(words[0]) in (3, 4) and words[0][0] in "lr" and name.upper() == name:
        return SIDES[words[0][0]]
    return ""


def is_part(name: str, part: str) -> bool:
    """Whether a name is of a part of the body: a key of :data:`WORDS`."""
    words = words_of(name)
    joined = {first + second for first, second in itertools.pairwise(words)}
    known = WORDS[part]
    marker = words[0][1:] if side(name) and len(words) <= 2 and len(words[0]) == 4 else ""
    return bool(known & ({*words, marker} | joined))


def numbers_of(names: Sequence[str], part: str, of_side: str = "") -> list[int]:
    """Numbers of the joints of a part, of one side where it is given."""
    return [k for k, name in enumerate(names) if is_part(name, part) and (not of_side or side(name) == of_side)]
