"""The libraries of :mod:`wbc.stack.generic` inside the package, for machines without a compiler.

``make wheel`` fills the folder before it packs the wheel: ``python -m wbc.stack.prebuilt``. A library is named by its
sources and by casadi's version, so that one of other code is never loaded.
"""

from __future__ import annotations

import hashlib
import pathlib
import platform
import sys
from collections.abc import Mapping
from importlib import metadata

FOLDER = pathlib.Path(__file__).parent / "prebuilt_libraries"


def place(files: Mapping[str, str]) -> pathlib.Path:
    """Where the library of these sources is, if it came with the package."""
    said = "\n".join((*files.values(), metadata.version("casadi"), sys.platform, platform.machine()))
    return FOLDER / f"{hashlib.sha256(said.encode()).hexdigest()[:32]}.so"


def main() -> None:
    """Compile all variants for any processor of this kind."""
    from wbc.native import toolchain
    from wbc.stack import generic

    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.so"):
        old.unlink()
    for variant in generic.variants():
        files = generic.sources(variant)
        toolchain.compile_generic(files, place(files), portable=True)
    found = list(FOLDER.glob("*.so"))
    print(f"{len(found)} libraries, {sum(path.stat().st_size for path in found) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
