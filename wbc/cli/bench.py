"""``wbc bench``: the benchmark of the repository."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import typer

from wbc.errors import WbcError

#: The repository, if the package is installed from one
ROOT = pathlib.Path(__file__).resolve().parents[2]


class BenchError(WbcError):
    """The benchmark is not there: it is part of the repository, not of the installed package."""


def bench(context: typer.Context) -> None:
    """Compare with pink, mink and placo on the same problems (needs the repository).

    Arguments after the command go to the benchmark: wbc bench --problems panda --rounds 2
    """
    if not (ROOT / "bench" / "__main__.py").is_file():
        reason = "the benchmark is not installed with the package; run it from a clone of the repository"
        raise BenchError("bench", str(ROOT / "bench"), reason)
    done = subprocess.run([sys.executable, "-m", "bench", *context.args], cwd=ROOT, check=False)
    raise typer.Exit(done.returncode)
