"""What names of joints, links and markers say: sides, and parts of a body."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence

#: A name's words: LeftUpLeg -> Left Up Leg, l_hip -> l hip, LANK -> LANK
NAME_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
#: Words of the left side
LEFT = {"left", "l", "lft", "fl", "hl", "rl", "bl", "lf", "lh", "lb"}
#: Words of the right side
RIGHT = {"right", "r", "rgt", "fr", "hr", "rr", "br", "rf", "rh", "rb"}
#: Words of front limbs
FRONT = {"front", "fore", "fl", "fr", "lf", "rf", "arm", "hand", "shoulder"}
#: Words of hind limbs
HIND = {"hind", "rear", "back", "hl", "hr", "rl", "rr", "bl", "br", "lh", "rh", "leg", "hip", "foot"}
#: Words of a single pair of limbs that is arms
ARM_WORDS = {"arm", "hand", "wrist", "elbow", "shoulder", "forearm", "gripper"}
#: Words of a single pair of limbs that is legs
LEG_WORDS = {"leg", "hip", "knee", "ankle", "foot", "toe", "thigh", "shin"}
#: Words of parts of a body, by part
PARTS = {
    "head": {"head", "neck", "nose", "skull", "hed", "hd", "fhd", "bhd"},
    "hip": {"hip", "upleg", "thigh", "upperleg", "femur", "asi", "psi"},
    "foot": {"foot", "ankle", "toe", "toebase", "heel", "ank", "hee", "mt5", "mt2"},
    "toe": {"toe", "toebase", "ball", "mt5", "mt2"},
    "hindfoot": {"ankle", "ank", "heel", "hee", "foot"},
    "ankle": {"ankle", "ank"},
    "knee": {"knee", "kne"},
    "shoulder": {"shoulder", "sho"},
    "elbow": {"elbow", "elb"},
    "wrist": {"wrist", "wra", "wrb"},
    "hand": {"hand", "fin", "finger"},
    "asis": {"asi", "asis"},
    "psis": {"psi", "psis"},
}
#: What a first letter l or r says the side of: parts, and markers of shanks, thighs and feet
SIDED = set[str]().union(*PARTS.values(), LEG_WORDS, ARM_WORDS, {"tib", "thi", "mt"}) - {"forearm", "gripper"}


def words(name: str) -> list[str]:
    """Words of a name in lower case; what stands before a colon is the subject's, and left out."""
    return [word.lower() for word in NAME_WORDS.findall(name.rpartition(":")[2])]


def side_of(name: str) -> int:
    """1 of a name that says left, -1 of one that says right, else 0; the first word that says it counts."""
    for word in words(name):
        side = word[0] if word[1:] in SIDED else ""
        if word in LEFT or side == "l":
            return 1
        if word in RIGHT or side == "r":
            return -1
    return 0


def numbers_of(names: Sequence[str], part: str, side: int = 0) -> list[int]:
    """Numbers of the names of a part, a key of :data:`PARTS`, and where it is given of a side as :func:`side_of`."""
    return [k for k, name in enumerate(names) if _is_part(name, part) and side in (0, side_of(name))]


def _is_part(name: str, part: str) -> bool:
    """Whether a word of a name, two of them as one, or either behind the letter of a side, says a part."""
    own = words(name)
    own += [first + second for first, second in itertools.pairwise(own)]
    return bool(PARTS[part] & {*own, *(word[1:] for word in own if word[0] in "lr")})
