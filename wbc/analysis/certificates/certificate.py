"""``certify``: whether coordinates always suffice, proved on all of joint space by subdivision with bounds."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.analysis.algebra.ring import Matrix
from wbc.analysis.algebra.trig_form import TrigForm, trig_form, used_joints
from wbc.analysis.certificates.block_proofs import block_proofs
from wbc.analysis.certificates.boxes import BoxSearch, Counts
from wbc.analysis.certificates.pieces import BoxPieces
from wbc.analysis.certificates.symmetry import Symmetry, fundamental_box, symmetries
from wbc.analysis.certificates.weakest import NumericWitness, numeric_witness, peak, weakest
from wbc.analysis.jacobians.jacobian import symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.jacobians.numeric import check_task
from wbc.analysis.jacobians.rank_matrix import rank_matrices
from wbc.analysis.loci.made_within import made_within
from wbc.analysis.rows import Rows, checked
from wbc.errors import RangeError

#: Verdicts
COMPLETE, INCOMPLETE, UNDECIDED = "complete", "incomplete", "undecided"
#: Boxes narrower than this in the joint to be cut are left undecided [rad]
SMALLEST = 1e-6
#: Matrices that are tried on random boxes of this half width [rad], how many boxes, and parts of each at most
_TRIED, _HALF, _SAMPLES, _BUDGET = 8, 0.3, 6, 400
#: Boxes to begin with, at least; the part of the time that choosing a matrix may take
_FIRST, _READY = 256, 0.2
#: What a look for a witness near undecided boxes gets where all time is spent [s]
_SPARE = 0.5

Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class RankCertificate:
    """What subdivision proved.

    Attributes:
        verdict: ``complete`` (where sigma_min(J_T) >= eps, task and constraints together have full rank),
            ``incomplete`` (see witness), ``undecided`` (see left).
        eps: width of the tube. peak: the largest sigma_min(J_T) that was found; eps is stated as a part of it.
        everywhere: no box needed the tube, so full rank holds at every configuration.
        counts: boxes and parts of the volume. left: part of the volume that is not decided.
        joints: that were subdivided, from 0. symmetries: that cut the volume. seconds: of all sittings, wall clock.
    """

    verdict: str
    eps: float
    peak: float
    everywhere: bool
    counts: Counts
    left: float
    joints: tuple[int, ...]
    symmetries: int
    seconds: float
    witness: NumericWitness | None = None


def certify(
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    *,
    part: float = 0.01,
    minutes: float = 30.0,
    workers: int | None = None,
    state: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    ended: Callable[[], bool] | None = None,
) -> RankCertificate:
    """Completeness outside a tube around the task's singularities, by branch and bound over joint space:

        sigma_min(J_T(q)) >= eps  implies  rank J_R(q) = m,     eps = part * max sigma_min(J_T)

    Without a task there is no tube: full rank everywhere, or a witness where it is lost.

    A box is done when first-order forms with bounded rests prove that a matrix with the rank deficiency of J_R has
    full column rank on all of it, or that sigma_min(J_T) < eps on all of it; else it is cut. Rounding is covered by
    padding. The matrix is taken whole and in two blocks (:func:`block_proofs`). Joints that appear in neither matrix
    are not subdivided, symmetries cut the rest. A numeric search for a witness goes first.

    Args:
        part: of the largest sigma_min(J_T), > 0 and < 1. minutes: by the clock, after which the rest is left undecided;
            with a state the preparation is not cut short.
        workers: threads; None: one a core. state: file that keeps what is done, and from which a second call goes on.
        progress: called with the decided part of the volume. ended: asked now and then whether to stop, as does a
            keyboard interrupt, with what is known so far.

    Source: bounds of eigenvalues of non-negative matrices for regularity of interval matrices: J. Rohn, "Systems of
    linear interval equations", Linear Algebra and its Applications 126, 1989.

    Raises:
        RangeError: numbers out of range, matrices too large, a task of full rank nowhere.
        UnsupportedJointError: entries in a sliding joint. RobotFileError: a state of another problem.
        CompileError: no C compiler.
    """
    part, minutes = _checked(part, minutes)
    wanted, added = _task(task), checked("constraints", constraints)
    workers, file = _means(workers, state, progress, ended)
    checked_model(model)
    until = (began := time.monotonic()) + 60.0 * minutes
    # What a file keeps must be the same problem for the next call, so there its preparation is not cut short
    last, ready = (until, began + 60.0 * _READY * minutes) if file is None else (np.inf, np.inf)
    if file is None and not made_within(model, (*wanted, *added), last - began):
        return _without_boxes(UNDECIDED, began)
    J_T, J_R = _matrices(model, wanted, added)
    matrices = []
    for matrix in rank_matrices(model, (*wanted, *added)):
        if not matrix:
            return _without_boxes(COMPLETE, began)
        matrices.append(matrix)
        if time.monotonic() > ready:
            break
    if time.monotonic() > last:
        return _without_boxes(UNDECIDED, began)
    own, every = trig_form(model.ring, J_T) if wanted else None, trig_form(model.ring, J_R)
    rng = np.random.default_rng(0)
    eps = part * (highest := 0.0 if own is None else peak(own, rng, last))
    witness_from = functools.partial(numeric_witness, model, wanted, added, every, eps=eps, until=last)
    witness = witness_from(starts=weakest(own, [every], eps, rng, last)[0])
    if witness is not None:
        return _without_boxes(INCOMPLETE, began, eps, highest, witness)
    chosen = _chosen(_shortest(model, matrices, ready), own, eps, ready)
    both, proofs = _both(chosen, own), block_proofs(model, (*wanted, *added), chosen.joints)
    found = symmetries(both, used_joints(both))
    pieces = _pieces((*proofs, (chosen,)), own, eps, found, file)
    finished, counts, verdict, left = pieces.work(until, workers, progress, ended), pieces.counts, COMPLETE, 0.0
    if not finished or counts.undecided > 0:
        verdict, left = UNDECIDED, max(0.0, 1.0 - counts.regular_part - counts.tube_part)
        spare = max(last, time.monotonic() + _SPARE)
        witness = witness_from(starts=pieces.kept[:, : model.robot.nv], until=spare) if len(pieces.kept) else None
        verdict = verdict if witness is None else INCOMPLETE
    tubed = counts.tube > 0
    cut, everywhere = used_joints(both) if tubed else chosen.joints, verdict == COMPLETE and not tubed
    return RankCertificate(verdict, eps, highest, everywhere, counts, left, cut, len(found), pieces.seconds, witness)


def _task(task: Any) -> tuple[Rows, ...]:
    return () if isinstance(task, tuple | list) and not task else checked("task", task)


def _means(workers: Any, state: Any, progress: Any, ended: Any) -> tuple[int, Path | None]:
    """Threads and file of a search; what it calls can be called."""
    for name, one in (("progress", progress), ("ended", ended)):
        validation.function(name, one)
    threads = os.cpu_count() or 1 if workers is None else validation.integer("workers", workers, low=1)
    return threads, None if state is None else validation.file_path("state", state)


def _without_boxes(
    verdict: str, began: float, eps: float = 0.0, highest: float = 0.0, witness: NumericWitness | None = None
) -> RankCertificate:
    """What is known before subdivision."""
    done, seconds = verdict == COMPLETE, time.monotonic() - began
    return RankCertificate(verdict, eps, highest, done, Counts(), 1.0 - done, (), 1, seconds, witness)


def _matrices(model: ExactModel, task: tuple[Rows, ...], constraints: tuple[Rows, ...]) -> tuple[Matrix, Matrix]:
    """J_T, of no rows where there is no task, and J_R."""
    J_T = symbolic_jacobian(model, task).matrix if task else []
    J_R = symbolic_jacobian(model, (*task, *constraints)).matrix
    joints = model.robot.nv
    if len(J_T) > joints or len(J_R) < joints:
        raise RangeError("rows", len(J_R), f"expected at least {joints} in all and at most {joints} in the task")
    if task:
        check_task(model.robot, task)
    return J_T, J_R


def _checked(part: float, minutes: float) -> tuple[float, float]:
    part, minutes = validation.scalar("part", part), validation.scalar("minutes", minutes)
    if not 0.0 < part < 1.0:
        raise RangeError("part", part, "expected more than 0 and less than 1")
    if minutes <= 0.0:
        raise RangeError("minutes", minutes, "expected more than 0")
    return part, minutes


def _both(augmented: TrigForm, task: TrigForm | None) -> tuple[TrigForm, ...]:
    return (augmented,) if task is None else (augmented, task)


def _shortest(model: ExactModel, matrices: Sequence[Matrix], until: float) -> list[TrigForm]:
    """The matrices with the fewest terms as waves; at least one, however late it is."""
    short = sorted(matrices, key=lambda matrix: sum(len(p) for row in matrix for p in row))
    found = [trig_form(model.ring, short[0])]
    for matrix in short[1:]:
        if time.monotonic() > until:
            break
        found.append(trig_form(model.ring, matrix))
    return sorted(found, key=lambda form: form.terms)[:_TRIED]


def _chosen(forms: Sequence[TrigForm], task: TrigForm | None, eps: float, until: float) -> TrigForm:
    """Of the forms the one that needs the fewest boxes on a sample; the first where there is no time for samples."""
    size = forms[0].waves.shape[1]
    rng = np.random.default_rng(1)
    centres = rng.uniform(-np.pi, np.pi, (_SAMPLES, size))
    best, least = forms[0], np.inf
    for form in forms:
        search = BoxSearch(((form,),), task, eps, SMALLEST, 1.0)
        half = np.where(np.isin(np.arange(size), used_joints(_both(form, task))), _HALF, 0.0)
        total = 0.0
        for centre in centres:
            if time.monotonic() > until:
                return best
            counts, left, _ = search.run(np.concatenate((centre, half, [0.0]))[None], _BUDGET)
            total += counts.boxes + len(left)
        if total < least:
            best, least = form, total
    return best


def _pieces(
    proofs: Sequence[Sequence[TrigForm]],
    task: TrigForm | None,
    eps: float,
    found: Sequence[Symmetry],
    file: Path | None,
) -> BoxPieces:
    """Joint space in boxes to be searched: halves along the joints of the augmented matrix in turn, shuffled."""
    augmented = proofs[-1][0]
    joints = used_joints(_both(augmented, task))
    centre, half = fundamental_box(found, joints)
    box = np.concatenate((centre, half, [0.0]))
    search = BoxSearch(proofs, task, eps, SMALLEST, float(np.prod(2.0 * half[list(joints)])))
    boxes, size, turn = box[None], len(centre), 0
    cut = augmented.joints or joints
    while len(boxes) < _FIRST:
        k = cut[turn % len(cut)]
        turn += 1
        low, high = boxes.copy(), boxes.copy()
        low[:, size + k] /= 2.0
        high[:, size + k] /= 2.0
        low[:, k] -= low[:, size + k]
        high[:, k] += high[:, size + k]
        boxes = np.concatenate((low, high))
    forms = [form for proof in proofs for form in proof]
    order = np.random.default_rng(2).permutation(len(boxes))
    return BoxPieces(search, boxes[order], file, (*forms, *_both(augmented, task)[1:]), eps)
