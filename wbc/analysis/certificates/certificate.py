"""``certify``: whether coordinates always suffice, proved on all of joint space by subdivision with bounds."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from wbc.analysis.certificates.weakest import RankWitness, numeric_witness, peak, weakest
from wbc.analysis.jacobians.jacobian import augmented_jacobian
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.jacobians.numeric import check_task
from wbc.analysis.jacobians.rank_matrix import rank_matrices
from wbc.analysis.loci.child import Child
from wbc.analysis.loci.made_within import made_within
from wbc.analysis.rows import Rows, checked
from wbc.errors import RangeError

#: Verdict: the set loses rank nowhere
COMPLETE = "complete"
#: Verdict: the set loses rank somewhere
INCOMPLETE = "incomplete"
#: Verdict: the time or the boxes ran out before either was shown
UNDECIDED = "undecided"
#: Boxes narrower than this in the joint to be cut are left undecided [rad]
SMALLEST = 1e-6
#: Matrices that are tried on random boxes
_TRIED = 8
#: Half width of a random box [rad]
_HALF = 0.3
#: Random boxes for each matrix
_SAMPLES = 6
#: Parts that a random box may be cut into
_PARTS = 400
#: Boxes to begin with, at least
_FIRST = 256
#: Parts of the time until which a matrix is chosen, boxes are looked at, and witnesses are searched for
_SHARES = 0.2, 0.9, 0.95
#: Between two looks at what is known [s]
_LOOK = 0.1

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
    witness: RankWitness | None = None


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
    problem = _Problem(model, wanted, added, part, workers, file)
    began, seconds = time.monotonic(), 60.0 * minutes

    def told(found: RankCertificate) -> None:
        if progress is not None:
            progress(found.counts.regular_part + found.counts.tube_part + found.counts.undecided_part)

    if file is not None:
        # What a file keeps must be the same problem for the next call, so there its preparation is not cut short
        return problem.decided(_Times(np.inf, began + seconds, np.inf), told, ended)
    if not made_within(model, (*wanted, *added), seconds):
        return _without_boxes(UNDECIDED, began)
    times = _Times(*(began + share * seconds for share in _SHARES))
    left, seen = began + seconds - time.monotonic(), 0
    with Child(lambda report: report(problem.decided(times, report, None)), left) as child:
        try:
            while True:
                done = child.wait(min(_LOOK, began + seconds - time.monotonic()))
                if len(child.reports) > seen:
                    seen = len(child.reports)
                    told(child.reports[-1])
                if done or time.monotonic() > began + seconds or (ended is not None and ended()):
                    break
        except KeyboardInterrupt:
            child.interrupt()
    found = child.reports[-1] if child.reports else _without_boxes(UNDECIDED, began)
    return replace(found, seconds=time.monotonic() - began)


@dataclass(frozen=True)
class _Times:
    """On the monotonic clock: when a matrix is chosen, when the last box is looked at, when searches by numbers end."""

    ready: float
    boxes: float
    last: float


@dataclass(frozen=True, eq=False)
class _Problem:
    """What is to be proved, and by what means."""

    model: ExactModel
    task: tuple[Rows, ...]
    constraints: tuple[Rows, ...]
    part: float
    workers: int
    file: Path | None

    def decided(
        self,
        times: _Times,
        told: Callable[[RankCertificate], None],
        ended: Callable[[], bool] | None,
    ) -> RankCertificate:
        """The certificate; ``told`` gets what is known while boxes are looked at."""
        model, every_row, began = self.model, (*self.task, *self.constraints), time.monotonic()
        J_T, augmented = augmented_jacobian(model, self.task, every_row)
        if self.task:
            check_task(model.robot, self.task)
        matrices = []
        for matrix in rank_matrices(model, every_row):
            if not matrix:
                return _without_boxes(COMPLETE, began)
            matrices.append(matrix)
            if time.monotonic() > times.ready:
                break
        own, every = trig_form(model.ring, J_T) if self.task else None, trig_form(model.ring, augmented.matrix)
        rng = np.random.default_rng(0)
        eps = self.part * (highest := 0.0 if own is None else peak(own, rng, times.last))
        nearest = functools.partial(numeric_witness, model, self.task, self.constraints, every, eps=eps)
        witness = nearest(weakest(own, [every], eps, rng, times.last)[0], until=times.last)
        if witness is not None:
            return _without_boxes(INCOMPLETE, began, eps, highest, witness)
        chosen = _chosen(_shortest(model, matrices, times.ready), own, eps, times.ready)
        both, proofs = _both(chosen, own), block_proofs(model, every_row, chosen.joints)
        found = symmetries(both, used_joints(both))
        pieces = _pieces((*proofs, (chosen,)), own, eps, found, self.file)

        def known(verdict: str, witness: RankWitness | None = None) -> RankCertificate:
            counts, complete = pieces.counts, verdict == COMPLETE
            left = 0.0 if complete else max(0.0, 1.0 - counts.regular_part - counts.tube_part)
            tubed = counts.tube > 0
            joints, everywhere = used_joints(both) if tubed else chosen.joints, complete and not tubed
            numbers = joints, len(found), pieces.seconds
            return RankCertificate(verdict, eps, highest, everywhere, counts, left, *numbers, witness)

        finished = pieces.work(times.boxes, self.workers, lambda _: told(known(UNDECIDED)), ended)
        if finished and not pieces.counts.undecided:
            return known(COMPLETE)
        witness = nearest(pieces.kept[:, : model.robot.nv], until=times.last) if len(pieces.kept) else None
        return known(UNDECIDED if witness is None else INCOMPLETE, witness)


def _task(task: Any) -> tuple[Rows, ...]:
    return () if isinstance(task, tuple | list) and not task else checked("task", task)


def _means(workers: Any, state: Any, progress: Any, ended: Any) -> tuple[int, Path | None]:
    """Threads and file of a search; what it calls can be called."""
    for name, one in (("progress", progress), ("ended", ended)):
        validation.function(name, one)
    threads = os.cpu_count() or 1 if workers is None else validation.integer("workers", workers, low=1)
    return threads, None if state is None else validation.file_path("state", state)


def _without_boxes(
    verdict: str, began: float, eps: float = 0.0, highest: float = 0.0, witness: RankWitness | None = None
) -> RankCertificate:
    """What is known before subdivision."""
    done, seconds = verdict == COMPLETE, time.monotonic() - began
    return RankCertificate(verdict, eps, highest, done, Counts(), 1.0 - done, (), 1, seconds, witness)


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
            counts, left, _ = search.run(np.concatenate((centre, half, [0.0]))[None], _PARTS)
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
