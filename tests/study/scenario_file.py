"""A scenario of a user: squares, and accidents on request, each of which happens once."""

import os
import signal
from pathlib import Path
from typing import TypedDict


class Found(TypedDict):
    square: float
    kind: float


def squares(*, seed: int, base: float, accident: str = "", name: str = "a") -> Found:
    """``accident``: a folder; the trial of seed 3 ends its process there with SIGKILL, once."""
    happened = Path(accident) / "happened"
    if accident and seed == 3 and not happened.exists():
        happened.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": base * base + seed, "kind": float(len(name))}


def rows(*, seed: int, count: int = 3) -> dict[str, list[float]]:
    if seed == 1:
        raise ZeroDivisionError("seed 1")
    if seed == 2:
        raise KeyboardInterrupt
    return {"x": [float(k) for k in range(count)], "y": [float("nan")] * count}


def seedless(*, base: float) -> Found:
    return {"square": base, "kind": 0.0}


def untyped(*, seed: int, base) -> Found:
    return {"square": base, "kind": 0.0}
