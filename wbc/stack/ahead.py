"""Hand-written C compiled ahead, when wbc is installed from a clone or becomes a wheel: ``python -m wbc.stack.ahead``.

``--platform linux-aarch64 --out FOLDER`` compiles it by zig for another kind of machine; nothing of that is run.

Imports nothing but what a build has: casadi, whose wheel has the solver, and platformdirs.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from wbc.errors import CompileError
from wbc.native import kernel, targets, toolchain
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


def build(target: targets.TargetMachine = targets.HERE, folder: Path | None = None) -> list[Path]:
    """Compile what is not there yet, and remove what is of other sources; where the libraries are.

    Args:
        target: with its solver. folder: of the libraries, of which none is removed; default: that of this package.

    Raises:
        CompileError: there is no compiler for the target, or it fails.
    """
    toolchain.require(target)
    place = folder or kernel.AHEAD
    place.mkdir(parents=True, exist_ok=True)
    tasks: dict[Path, Callable[[Path], None]] = {}
    for variant in generic.variants():
        texts = generic.origins(variant)
        tasks[place / kernel.ahead(texts, target).name] = partial(generic.compiling(variant, target), texts)
    for name in KERNELS:
        texts = kernel.texts_of(_WBC / name, *(_WBC / folder / "native" for folder in ("clearance", "geometry")))
        compiled = partial(toolchain.compile_kernel, texts, target=target)
        tasks[place / kernel.ahead(texts, target).name] = compiled
    for old in set(kernel.AHEAD.glob(f"*{target.suffix}")) - set(tasks) if folder is None else ():
        old.unlink()
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        list(pool.map(lambda path: path.exists() or tasks[path](path), tasks))
    return sorted(tasks)


def main() -> None:
    """Compile, and say how much that made."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--platform", choices=sorted(targets.OTHERS), help="Another kind of machine; needs ziglang.")
    parser.add_argument(
        "--out", type=lambda given: Path(given).resolve(), help="Folder of the libraries; default: this package's."
    )
    given = parser.parse_args()
    if given.platform and not given.out:
        parser.error("--platform needs --out, a folder: those in the package are for this machine")
    try:
        target = targets.with_solver(given.platform, given.out / "solver") if given.platform else targets.HERE
        made = build(target, given.out)
    except CompileError as error:
        sys.exit(f"nothing was compiled: {error}")
    print(f"{len(made)} libraries, {sum(path.stat().st_size for path in made) / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
