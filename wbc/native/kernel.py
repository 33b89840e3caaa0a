"""C of a package's own, next to its modules, as a library in the cache."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from wbc.native import cache, toolchain


def kernel(sources: Path, files: Sequence[str | Path]) -> Path:
    """The library of C files in a folder, the last of which is compiled; named in the cache by what they say.

    Args:
        files: names in the folder, or paths of headers of another package.

    Raises:
        CompileError: there is no compiler, or it fails.
    """
    texts = {Path(name).name: (sources / name).read_text(encoding="utf-8") for name in files}
    main = Path(files[-1]).name
    name = hashlib.sha256("\n".join((*texts.values(), toolchain.identity())).encode()).hexdigest()
    library = Path(main).with_suffix(".so").name

    def fill(folder: Path) -> None:
        toolchain.compile_library(texts, main, folder / library)

    folder, _ = cache.fetch(name, fill, library=True)
    return folder / library
