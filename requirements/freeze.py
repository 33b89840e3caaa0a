"""Prints name==version of everything that wbc[dev] needs, as installed in the running environment."""

from __future__ import annotations

import sys
from importlib import metadata

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

HEADER = """\
# Every package that wbc[dev] needs, direct or not, at the version that is tested. Written by `make lock`.
"""


def closure(name: str, extras: frozenset[str], seen: dict[str, str]) -> None:
    """Add to ``seen`` what distribution ``name`` with ``extras`` requires on this platform."""
    for text in metadata.requires(name) or ():
        requirement = Requirement(text)
        wanted = requirement.marker is None or any(
            requirement.marker.evaluate({"extra": extra}) for extra in (extras or {""})
        )
        child = canonicalize_name(requirement.name)
        # An extra may ask for others of its own package
        if not wanted or (child in seen and child != name):
            continue
        seen[child] = metadata.version(child)
        closure(child, frozenset(requirement.extras), seen)


def main() -> None:
    """Write the lock to standard output."""
    found: dict[str, str] = {}
    closure("wbc", frozenset({"", "dev"}), found)
    found.pop("wbc", None)
    sys.stdout.write(HEADER + "".join(f"{name}=={version}\n" for name, version in sorted(found.items())))


if __name__ == "__main__":
    main()
