"""Libraries of :mod:`wbc.stack.generic` for machines without a compiler, which ``make wheel`` packs."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

from wbc.native import toolchain
from wbc.stack import generic


def main() -> None:
    """Compile all variants for any processor of this kind."""
    generic.PREBUILT.mkdir(exist_ok=True)
    for old in generic.PREBUILT.glob("*.so"):
        old.unlink()
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        list(pool.map(_compile, generic.variants()))
    found = list(generic.PREBUILT.glob("*.so"))
    print(f"{len(found)} libraries, {sum(path.stat().st_size for path in found) / 1e6:.1f} MB")


def _compile(variant: generic.Variant) -> None:
    files = generic.sources(variant)
    toolchain.compile_generic(files, generic.prebuilt(files), portable=True)


if __name__ == "__main__":
    main()
