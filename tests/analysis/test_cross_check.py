"""Exact loci of the Space Station arm against numbers: singular values on and off them, and bounds of boxes."""

from __future__ import annotations

from functools import cache
from itertools import islice

import numpy as np
import pytest

from tests.analysis.jacobians import jacobians
from wbc.analysis import Analysis, ExactModel, analyse, published_sets, symbolic_jacobian
from wbc.analysis.algebra.points import angle, form_value, joint_roots, real_point
from wbc.analysis.algebra.trig_form import TrigForm, trig_form, used_joints
from wbc.analysis.certificates.boxes import BoxSearch
from wbc.analysis.jacobians.numeric import rank
from wbc.analysis.jacobians.rank_matrix import rank_matrices
from wbc.validation import Array

SETS = published_sets("ssrms")
#: Sets whose loci are compared; the last is the 11 x 7 one
CHOSEN = ("q1", "alpha", "elbow, beta, gamma")
#: So many configurations off a locus are looked at
OFF_LOCUS = 10
#: A configuration counts as off the locus with every condition this far from true [rad, and of relations' terms]
OFF = 0.15


@cache
def run(chosen: str) -> Analysis:
    return analyse(ExactModel(SETS.robot, SETS.symbols), SETS.task, SETS.sets[chosen])


@cache
def form(chosen: str) -> TrigForm:
    """A short matrix of the rank of the rows."""
    model = ExactModel(SETS.robot)
    matrices = islice(rank_matrices(model, (*SETS.task, *SETS.sets[chosen])), 6)
    return min((trig_form(model.ring, m) for m in matrices), key=lambda one: one.terms)


def on_locus(chosen: str, rng: np.random.Generator) -> list[Array]:
    """Two points on each branch."""
    found = run(chosen)
    points: list[Array] = []
    for branch in found.locus.branches:
        here = [p for p in (real_point(found.exact.half, branch, rng) for _ in range(12)) if p is not None]
        assert here
        points += here[:2]
    return points


def off_locus(chosen: str, rng: np.random.Generator) -> list[Array]:
    """Configurations that keep from every branch by one of its conditions."""
    half = run(chosen).exact.half

    def far(q: Array) -> bool:
        for branch in run(chosen).locus.branches:
            off = [abs(np.angle(np.exp(1j * (q[v.joint] - angle(v, half))))) for v in branch.values]
            off += [abs(form_value(half, r, q)) for r in branch.relations]
            if max(off) < OFF:
                return False
        return True

    return [q for q in rng.uniform(-np.pi, np.pi, (40, 7)) if far(q)][:OFF_LOCUS]


@pytest.mark.parametrize("chosen", CHOSEN)
def test_singular_values_are_zero_on_the_locus_and_not_off_it(chosen: str) -> None:
    rng = np.random.default_rng(0)
    on, off = on_locus(chosen, rng), off_locus(chosen, rng)
    assert len(on) >= 8
    assert len(off) == OFF_LOCUS
    for q in on:
        assert rank(jacobians("ssrms", chosen, q)[1]) < 7
    least = [np.linalg.svd(jacobians("ssrms", chosen, q)[1], compute_uv=False)[-1] for q in off]
    assert min(least) > 1e-3


@pytest.mark.parametrize("chosen", ["q1", "elbow, beta, gamma"])
def test_bounds_prove_boxes_off_the_locus_and_none_that_meets_it(chosen: str) -> None:
    """Small boxes: all of those off it are proved to have full rank, none of those about a point of it."""
    rng, matrix = np.random.default_rng(1), form(chosen)
    search = BoxSearch(((matrix,),), None, 0.0, 1e-6, 1.0)
    half = np.where(np.isin(np.arange(7), used_joints((matrix,))), 1.0, 0.0)

    def proved(q: Array, width: float) -> bool:
        return search.run(np.concatenate((q, width * half, [0.0]))[None], 1)[0].regular == 1

    assert not any(proved(q + 0.3 * w * rng.uniform(-1, 1, 7), w) for q in on_locus(chosen, rng) for w in (0.1, 1e-3))
    assert all(proved(q, 1e-4) for q in off_locus(chosen, rng))


def test_the_task_is_deficient_on_the_locus_that_is_loose_and_has_full_rank_where_a_set_is_incomplete() -> None:
    rng = np.random.default_rng(2)
    for chosen in CHOSEN:
        ranks = {rank(jacobians("ssrms", chosen, q)[0]) for q in on_locus(chosen, rng)}
        assert run(chosen).verdict == ("loose" if chosen == "elbow, beta, gamma" else "incomplete")
        assert ranks == ({5} if run(chosen).verdict == "loose" else {6})


def test_roots_of_a_relation_are_where_the_determinant_changes_its_sign() -> None:
    """alpha, (4.32): det of the square matrix on both sides of each root in q4."""
    found = run("alpha")
    (relation,) = {r for b in found.locus.branches for r in b.relations}
    q = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])
    model = ExactModel(SETS.robot)
    det = trig_form(model.ring, symbolic_jacobian(model, (*SETS.task, *SETS.sets["alpha"])).matrix)
    for root in joint_roots(found.exact.half, relation, 3, q):
        sides = np.array([q, q])
        sides[:, 3] = root - 1e-4, root + 1e-4
        below, above = np.linalg.det(det.value(sides))
        assert below * above < 0.0
