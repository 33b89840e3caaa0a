"""Hand-written C compiled ahead, when wbc is installed from a clone or becomes a wheel: ``python -m wbc.stack.ahead``.

Imports nothing but what a build has: casadi, whose wheel has the solver, and platformdirs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from wbc.native import kernel, toolchain
from wbc.stack import generic

_WBC = Path(__file__).parents[1]
#: C files that :func:`wbc.native.kernel.kernel` is asked for, from the package's top
KERNELS = (
    "analysis/certificates/native/subdivide.c",
    "clearance/native/sweep.c",
    "climb/native/climb.c",
    "coordinates/control/native/singular.c",
    "geometry/native/geometry.c",
    "plan/native/plan.c",
    "proximity/native/sensor.c",
    "resolvers/fsp/native/fsp.c",
)


def build() -> list[Path]:
    """Compile what is not there yet, and remove what is of other sources; where the libraries are.

    Raises:
        CompileError: there is no compiler, or it fails.
    """
    toolchain.require()
    kernel.AHEAD.mkdir(exist_ok=True)
    tasks: dict[Path, Callable[[Path], None]] = {}
    for variant in generic.variants():
        texts = generic.origins(variant)
        tasks[kernel.ahead(texts)] = partial(generic.compiling(variant, portable=True), texts)
    for name in KERNELS:
        texts = kernel.texts_of(_WBC / name, *(_WBC / folder / "native" for folder in ("clearance", "geometry")))
        tasks[kernel.ahead(texts)] = partial(toolchain.compile_kernel, texts, portable=True)
    for old in set(kernel.AHEAD.glob("*.so")) - set(tasks):
        old.unlink()
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        list(pool.map(lambda path: path.exists() or tasks[path](path), tasks))
    return sorted(tasks)


if __name__ == "__main__":
    found = build()
    print(f"{len(found)} libraries, {sum(path.stat().st_size for path in found) / 1e6:.1f} MB")
