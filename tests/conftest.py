"""Settings of the whole test suite: deterministic examples, headless plots, native code cached in the repository."""

from __future__ import annotations

import gc
import os
import sys
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

pytest_plugins = [
    f"tests.{name}"
    for name in ("lacking", "processes", "slow", "pictures", "browsers", "seeds", "backends", "loading", "failures")
]

os.environ.setdefault("MPLBACKEND", "Agg")
# One thread a process: pytest-xdist already fills the cores, and sums keep their order.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
# The same arithmetic, compiled in a fraction of the time: hundreds of stacks are compiled, and none of them is timed;
# tests/controller/test_optimised.py compares it with what users get
os.environ.setdefault("WBC_TICK_FLAGS", "-O0")
os.environ.setdefault("WBC_ROWS_FLAGS", "-O0")
# Compiled ticks of the tests stay out of the user's cache, and survive from run to run.
BUILD = Path(__file__).parents[1] / "build"
os.environ.setdefault("XDG_CACHE_HOME", str(BUILD / "test-cache"))
# Where no bytecode may be written beside the sources, every process of the suite would compile all modules that it
# imports, which takes longer than most tests
if sys.dont_write_bytecode:
    sys.dont_write_bytecode, sys.pycache_prefix = False, str(BUILD / "bytecode")
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

#: Seconds that a worker waits for another's bytecode
PATIENCE = 60.0

# Imported here, when the flags above are set
from tests import objects  # noqa: E402
from tests.repeats import repeats  # noqa: E402

objects.keep(BUILD / "test-cache" / "objects")

# Workers that collect at once compile the same modules at once: where there is no bytecode yet, one goes ahead
FIRST = BUILD / "test-cache" / f"collected-{sys.implementation.cache_tag}"


def pytest_sessionstart(session: pytest.Session) -> None:
    if os.environ.get("PYTEST_XDIST_WORKER", "gw0") != "gw0":
        until = time.monotonic() + PATIENCE
        while not FIRST.exists() and time.monotonic() < until:
            time.sleep(0.1)


# Thousands of tests are collected, and live to the end: searching them for garbage again and again takes a sixth of the
# time of the collection, and a part of every later search
gc.disable()


def pytest_collection_finish(session: pytest.Session) -> None:
    FIRST.touch()
    gc.freeze()
    # Expressions and arrays come and go by the thousand and are seldom in circles
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


settings.register_profile(
    "wbc",
    derandomize=True,
    deadline=None,
    max_examples=repeats(25),
    database=None,
    print_blob=False,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("wbc")
