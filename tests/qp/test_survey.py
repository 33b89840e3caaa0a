"""The survey runs each solver in a child process and survives what happens there."""

from __future__ import annotations

from bench.qp.survey import survey, table


def test_supported_solver_passes_and_the_others_are_reported():
    good, refused = survey(["qpoases", "hpipm"], count=1)
    assert good.note == ""
    assert good.solved == good.problems == 24
    assert good.error[0] < good.bound < 1e-6
    assert good.wrong == 0
    assert good.refused == good.infeasible == 20
    assert "hpipm" in refused.note
    text = table([good, refused])
    assert "| qpoases | 24 of 24 |" in text
    assert refused.note in text


def test_a_hanging_child_is_ended():
    (finding,) = survey(["daqp"], count=1, timeout=0.05)
    assert finding.note == "not done after 0.05 s"
    assert finding.solved == 0
