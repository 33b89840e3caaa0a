"""Certificates by subdivision: verdicts, agreement with the exact method, resumption, soundness of the bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.analysis.jacobians import jacobians
from wbc.analysis import BodyRows, ExactModel, JointRows, candidate_rows, certify, published_sets, symbolic_jacobian
from wbc.analysis.algebra.trig_form import TrigForm, trig_form, used_joints
from wbc.analysis.certificates.block_proofs import block_proofs
from wbc.analysis.certificates.boxes import BoxSearch
from wbc.analysis.certificates.screen import screen
from wbc.analysis.certificates.symmetry import fundamental_box, symmetries
from wbc.analysis.jacobians.numeric import rank
from wbc.analysis.jacobians.rank_matrix import rank_matrices
from wbc.errors import RangeError, RobotFileError, UnknownNameError, UnsupportedJointError
from wbc.robots import operator_arm

#: Robot, set and what certify says; the exact method says the same (tests/analysis/test_completeness.py)
VERDICTS = {
    ("planar_3r", "middle"): "complete",
    ("spherical_4r", "alpha"): "incomplete",
    ("spherical_4r", "elbow"): "incomplete",
    ("spherical_4r", "elbow, beta"): "complete",
}


@pytest.mark.parametrize(("name", "chosen"), VERDICTS)
def test_verdicts_are_those_of_the_exact_method(name: str, chosen: str) -> None:
    sets = published_sets(name)
    found = certify(ExactModel(sets.robot), sets.task, sets.sets[chosen], workers=1)
    assert found.verdict == VERDICTS[name, chosen]
    assert found.eps == pytest.approx(0.01 * found.peak)
    assert found.counts.undecided == 0
    if found.verdict == "complete":
        # Loose by the exact method, so the tube was needed
        assert not found.everywhere
        assert found.counts.tube > 0
        assert found.counts.regular_part + found.counts.tube_part == pytest.approx(1.0, abs=1e-9)
        return
    assert found.witness is not None
    J_T, J_R = jacobians(name, chosen, found.witness.q)
    assert np.linalg.svd(J_T, compute_uv=False)[-1] >= found.eps
    assert rank(J_R) < sets.robot.nv


def test_constants_alone_can_prove_it_and_sliding_joints_are_refused() -> None:
    """RP: the end of link 1 and the tip, in the axes of link 1, lose no rank; the tip alone depends on the slide."""
    robot = operator_arm("planar_rp").robot
    model = ExactModel(robot)
    points = [BodyRows(f, expressed="F1", translation=(0, 1), rotation=()) for f in ("tip", "end1")]
    found = certify(model, points[:1], points[1:])
    assert (found.verdict, found.everywhere, found.counts.boxes) == ("complete", True, 0.0)
    with pytest.raises(UnsupportedJointError):
        certify(model, points[:1], [JointRows("joint2")])


def test_going_on_from_a_file(tmp_path: Path) -> None:
    sets = published_sets("spherical_4r")
    model, rows = ExactModel(sets.robot), sets.sets["elbow, beta"]
    file = tmp_path / "state.npz"
    cut = certify(model, sets.task, rows, minutes=1e-6, workers=1, state=file)
    assert cut.verdict == "undecided"
    assert 0.0 < cut.left < 1.0
    whole = certify(model, sets.task, rows, workers=1, state=file)
    assert whole.verdict == "complete"
    assert whole.counts.boxes > cut.counts.boxes
    with pytest.raises(RobotFileError, match="another"):
        certify(model, sets.task, rows, part=0.02, state=file)
    file.write_text("no state")
    with pytest.raises(RobotFileError, match="not a state"):
        certify(model, sets.task, rows, state=file)


def test_an_interrupt_keeps_what_is_known_and_a_second_call_goes_on(tmp_path: Path) -> None:
    sets = published_sets("spherical_4r")
    model, rows, file = ExactModel(sets.robot), sets.sets["elbow, beta"], tmp_path / "state.npz"

    def interrupted(part: float) -> None:
        raise KeyboardInterrupt

    cut = certify(model, sets.task, rows, workers=1, state=file, progress=interrupted)
    assert cut.verdict == "undecided"
    assert 0.0 < cut.left < 1.0
    assert file.exists()
    whole = certify(model, sets.task, rows, workers=1, state=file)
    assert whole.verdict == "complete"
    assert whole.counts.boxes > cut.counts.boxes
    assert whole.counts.regular_part + whole.counts.tube_part == pytest.approx(1.0, abs=1e-9)


def test_boxes_that_are_proved_have_full_rank_and_those_in_the_tube_lie_in_it() -> None:
    """Sampled, on the Space Station arm: both claims hold at random configurations of each box."""
    sets = published_sets("ssrms")
    model, rng = ExactModel(sets.robot), np.random.default_rng(3)
    rows = (*sets.task, *sets.sets["elbow, beta, gamma"])
    matrix = min((trig_form(model.ring, m) for m in rank_matrices(model, rows)), key=lambda form: form.terms)
    full = trig_form(model.ring, symbolic_jacobian(model, sets.task).matrix)
    never = TrigForm((1, 1), np.zeros((0, 7)), np.zeros((1, 0)), np.zeros((1, 0)))
    eps, seen = 0.4, {"regular": 0, "tube": 0}
    proofs = (*block_proofs(model, rows, matrix.joints), (matrix,))
    assert [[form.joints for form in proof] for proof in proofs[:2]] == [[(4, 5), (1, 2)], [(1, 2), (4, 5)]]
    ranks, tubes = BoxSearch(proofs, None, 0.0, 1e-6, 1.0), BoxSearch(((never,),), full, eps, 1e-6, 1.0)
    for half in (0.2, 0.05, 0.02):
        for _ in range(40):
            centre = rng.uniform(-np.pi, np.pi, 7)
            centre[3] *= 0.05
            box = np.concatenate((centre, np.full(7, half), [0.0]))[None]
            points = centre + rng.uniform(-half, half, (40, 7))
            if ranks.run(box, 1)[0].regular:
                seen["regular"] += 1
                assert np.linalg.svd(matrix.value(points), compute_uv=False)[:, -1].min() > 0.0
            if tubes.run(box, 1)[0].tube:
                seen["tube"] += 1
                assert np.linalg.svd(full.value(points), compute_uv=False)[:, -1].max() < eps
    assert min(seen.values()) > 10


def test_symmetries_change_no_singular_value_and_their_box_stands_for_all() -> None:
    sets = published_sets("spherical_4r")
    model, rng = ExactModel(sets.robot), np.random.default_rng(0)
    form = trig_form(model.ring, symbolic_jacobian(model, sets.task).matrix)
    found = symmetries([form], used_joints([form]))
    assert len(found) > 4
    q = rng.uniform(-np.pi, np.pi, (20, 4))
    for moved in found:
        there = q * np.array(moved.signs) + np.pi * np.array(moved.turns)
        np.testing.assert_allclose(
            np.linalg.svd(form.value(there), compute_uv=False),
            np.linalg.svd(form.value(q), compute_uv=False),
            atol=1e-12,
        )
    centre, half = fundamental_box(found, form.joints)
    inside = []
    for point in q:
        images = np.array([point * np.array(m.signs) + np.pi * np.array(m.turns) for m in found])
        off = np.remainder(images - centre + np.pi, 2 * np.pi) - np.pi
        inside.append((np.abs(off)[:, list(form.joints)] <= half[list(form.joints)] + 1e-9).all(1).any())
    assert all(inside)
    assert np.prod(half[list(form.joints)]) < np.pi**3


def test_screen_leaves_what_has_no_witness() -> None:
    sets = published_sets("spherical_4r")
    found = screen(ExactModel(sets.robot), sets.task, candidate_rows("spherical_4r"), most=2)
    assert {len(s.names) for s in found} == {2}
    assert ("alpha", "beta") in {s.names for s in found}
    assert list(found) == sorted(found, key=lambda s: -s.ratio)
    assert not screen(ExactModel(sets.robot), sets.task, {"alpha": candidate_rows("spherical_4r")["alpha"]})


def test_bad_requests() -> None:
    sets = published_sets("spherical_4r")
    model, rows = ExactModel(sets.robot), sets.sets["alpha"]
    for changes in ({"part": 0.0}, {"part": 1.0}, {"minutes": 0.0}):
        with pytest.raises(RangeError):
            certify(model, sets.task, rows, **changes)  # type: ignore[arg-type]
    with pytest.raises(RangeError):
        certify(model, [JointRows("joint1")], [JointRows("joint2")])
    with pytest.raises(RangeError):
        screen(model, sets.task, candidate_rows("spherical_4r"), most=0)
    with pytest.raises(UnknownNameError):
        candidate_rows("planar_3r")
