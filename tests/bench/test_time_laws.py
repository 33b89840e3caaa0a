"""The benchmark of laws: small runs, what Ctrl-C leaves, and judges that find what is wrong."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.progress import Progress

from bench.time_laws import __main__ as run, least_time, raw, states
from bench.time_laws.tables import sheets
from tests.trajectory import random_motions as families
from wbc.trajectory import Law, PolynomialPath, jerk_limited


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, dict[str, Any]]:
    """What a tiny run writes."""
    folder = tmp_path_factory.mktemp("laws")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(least_time, "REFERENCE", 1601)
        run.main(["--share", "0.001", "--processes", "1", "--seed", "3", "--output", str(folder)])
    return (folder / "time_laws.md").read_text(), json.loads((folder / "time_laws.json").read_text())


def test_every_part_has_a_table(written: tuple[str, dict[str, Any]]) -> None:
    page, found = written
    assert found["interrupted"] is None
    assert len(found["tables"]) == len(run.QUICK)
    for table in found["tables"]:
        assert table["rows"]
        assert all(len(row) == len(table["columns"]) for row in table["rows"])
        assert table["title"] in page
    assert "toppra 0." in page
    assert "seed 3" in page


def test_ctrl_c_keeps_what_was_measured() -> None:
    def endless() -> Iterator[dict[str, Any]]:
        yield from least_time.small_moves(np.random.default_rng(0), 1)
        os.kill(os.getpid(), signal.SIGINT)
        yield from least_time.small_moves(np.random.default_rng(0), 1000)

    work = {"small moves": (7007, endless()), "states": (5, states.random_states(1, 5, 1))}
    with Progress(disable=True) as progress:
        parts, where = run.measure(work, progress)
    assert where == "small moves"
    assert set(parts) == {"small moves"}
    assert 7 <= len(parts["small moves"]) < 7000
    assert len(sheets(parts)) == 1


@pytest.mark.parametrize("family", families.FAMILIES)
def test_the_judge_of_states_finds_what_is_wrong(family: str) -> None:
    rng = np.random.default_rng(7)
    asked = [families.drawn(family, rng) for _ in range(5)]
    laws = [jerk_limited(**a) for a in asked]
    excess, off = families.misses(laws, asked)
    assert excess < 1e-9
    assert off < 1e-8
    slower = [{**a, "jerk": 0.9 * a["jerk"]} for a in asked]
    assert families.misses(laws, slower)[0] > 0.05
    moved = [*asked[:4], {**asked[4], "target_velocity": asked[4]["target_velocity"] + 1e-3}]
    assert families.misses(laws, moved)[1] > 0.9e-3
    path = laws[2].path
    assert isinstance(path, PolynomialPath)
    c = path.coefficients.copy()
    c[-1, -1] += 1e-2
    broken = Law(PolynomialPath(path.knots, c), laws[2].timing)
    assert families.misses([*laws[:2], broken, *laws[3:]], asked)[1] > 0.9e-2


def test_toppra_s_output_is_judged_as_it_is() -> None:
    """As a law it has the positions, velocities and accelerations that toppra itself evaluates."""
    problem = least_time.Problem(*least_time.random_problem(np.random.default_rng(2), 5))
    for points, how in ((None, raw.DEFAULT), (201, raw.CONSTANT)):
        found, instance, path = problem.theirs(points, **how)
        law = problem.law(found, instance, path)
        assert law is not None
        assert law.duration == pytest.approx(found.duration, rel=1e-9)
        times = np.linspace(0.01, 0.99, 57) * law.duration
        state = law.at(times)
        np.testing.assert_allclose(state.position, found(times), atol=1e-8)
        np.testing.assert_allclose(state.velocity, found(times, 1), atol=1e-6)
        seen = np.abs(found(np.linspace(0.0, law.duration, 4001), 2) / problem.acceleration).max()
        ratio = law.certificate.worst["acceleration"].ratio
        assert seen <= ratio * (1.0 + 1e-9)
        assert seen > ratio - 2e-2
    easy = replace(problem, acceleration=2.0 * problem.acceleration)
    assert easy.ours().duration < problem.ours().duration
