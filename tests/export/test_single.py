"""The export in single precision beside that in double, built on this machine.

Needs DAQP's source archive, which is not part of this project: WBC_DAQP_ARCHIVE names it.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from bench.measured import cortex_m7
from tests.export.cases import panda
from tests.export.single import (
    SINGLE,
    UNOPTIMISED,
    MissingProgramError,
    States,
    build_here,
    in_closed_loop,
    need,
    random_cases,
    ticks_here,
)
from wbc.export.exporting import vectors
from wbc.tick.outcome import STATUSES, Status


@pytest.fixture(scope="module")
def archive() -> str:
    """DAQP's source."""
    path = os.environ.get("WBC_DAQP_ARCHIVE", "")
    return path or pytest.skip("WBC_DAQP_ARCHIVE names no archive of DAQP's source")


@pytest.fixture(scope="module")
def folder(archive: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Panda in single precision."""
    place = panda().export(tmp_path_factory.mktemp("single") / "panda", solver_source=archive, states=1)
    build_here(place, SINGLE, *UNOPTIMISED)
    return place


@pytest.mark.parametrize("anywhere", [False, True])
def test_a_panda_has_the_statuses_and_nearly_the_commands_of_double(folder: Path, anywhere: bool) -> None:
    states = in_closed_loop(panda(), 400, 2) if anywhere else States(vectors(panda(), 400), 7, 7)
    single = ticks_here(folder, states)
    assert (single.status == states.status).all()
    off = np.abs(single.v - states.v).max(axis=1)
    assert np.median(off) < 1e-5
    assert np.percentile(off, 99) < 1e-2


def test_random_stacks_have_the_statuses_of_double(archive: str) -> None:
    for case in random_cases(range(200, 203), 200, archive):
        assert case.differ == 0, case.label
        assert np.median(case.off) < 1e-4, case.label


def test_numbers_that_are_none_are_refused_or_brake_as_in_double(folder: Path) -> None:
    rng, c = np.random.default_rng(0), panda()
    states = in_closed_loop(c, 300, 3)
    rows, inputs = states.rows.copy(), np.arange(14, states.rows.shape[1] - 8)
    for row in rows[:200]:
        row[rng.integers(14) if rng.random() < 0.5 else rng.choice(inputs)] = rng.choice([np.nan, np.inf, -np.inf])
    for row in rows[200:]:  # numbers that a float cannot hold, or whose squares it cannot
        row[rng.choice(inputs)] = rng.choice([1e300, -1e38, 1e25])
    single = ticks_here(folder, States(rows, 7, 7))
    assert np.isfinite(single.v).all()
    assert (np.abs(single.v) <= c.stack.robot.limits.velocity).all()
    unknown = ~np.isfinite(rows[:, :14]).all(axis=1)
    assert ((single.status < 0) == unknown).all()
    # A pose that is not finite is read; what is not read, such as that of a row that is off, changes nothing
    braked = single.status == STATUSES.index(Status.BRAKED)
    assert (braked | unknown | (single.status == states.status))[:200].all()
    assert (braked[:200] & ~unknown[:200]).sum() > 50


def test_a_missing_program_is_named_before_anything_is_built(monkeypatch: pytest.MonkeyPatch) -> None:
    found = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name: None if name == "qemu-system-arm" else found("sh"))
    with pytest.raises(MissingProgramError, match=r"not on the PATH.*qemu-system-arm"):
        cortex_m7.parts()
    need("gcc")
