"""Whether a set of task and constraint coordinates always suffices, with a witness where it does not."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc import validation
from wbc.analysis.algebra.branches import LocusBranch
from wbc.analysis.algebra.deficiency import Exact
from wbc.analysis.algebra.locus import Locus
from wbc.analysis.algebra.points import real_point
from wbc.analysis.certificates.certificate import COMPLETE, INCOMPLETE, RankCertificate, certify
from wbc.analysis.certificates.weakest import RankWitness
from wbc.analysis.jacobians.jacobian import SymbolicJacobian, symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.jacobians.numeric import NumericRows, check_task, rank, singular_values
from wbc.analysis.loci.budget import Budget, processor_seconds
from wbc.analysis.loci.child import Child, Report
from wbc.analysis.loci.loci import STRICT, UNDECIDED, Loci, LocusSearch
from wbc.analysis.loci.made_within import made_within
from wbc.analysis.rows import Rows, checked
from wbc.errors import CompileError, RangeError, UnsupportedJointError
from wbc.robot import Robot
from wbc.validation import Array

#: Random points on a branch that are tried for a witness
TRIES = 40
#: Time that the exact method has alone before numbers are asked as well [s]
HEAD = 1.0
#: Least time of a certificate [min]
_LEAST = 1e-6
#: Part of the time that the search may take
_SEARCH = 0.9
#: What is left at least for points of branches [s]
_AFTER = 0.2


@dataclass(frozen=True, eq=False)
class Analysis:
    """Rank analysis of one set.

    Attributes:
        joints: names, in the order of the labels q1, q2, ...
        exact: arithmetic of the robot, which writes the branches. task, augmented: the symbolic Jacobians.
        locus: where the augmented one has less than its full rank. algorithmic: branches on which the task alone
            keeps full rank. verdict: ``strict`` (no such configuration), ``loose`` (only where the task itself is
            deficient), ``incomplete``, ``complete`` (by the certificate, outside its tube; inside it is not decided),
            or ``undecided``. witness: for ``incomplete``.
        certificate: the one that was asked for the verdict, if any. seconds: by the clock. processor: processor time
            of all threads and processes [s].
    """

    joints: tuple[str, ...]
    exact: Exact
    task: SymbolicJacobian
    augmented: SymbolicJacobian
    locus: Locus
    algorithmic: tuple[LocusBranch, ...]
    verdict: str
    witness: RankWitness | None
    certificate: RankCertificate | None
    seconds: float
    processor: float


def analyse(
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    *,
    algorithm: str = "sub_determinants",
    budget: Budget | None = None,
    certificate: RankCertificate | None = None,
    progress: Callable[[str], None] | None = None,
) -> Analysis:
    """Completeness of task and constraint coordinates: { q : rank J_R < m } within { q : rank J_T < n }.

    J_T are the rows of the task, J_R those of task and constraints, m the number of joints. If the tall J_R has rank m
    and J_T full rank, some rows of the constraints complete the task; so one locus stands for all pairs.

    The locus is searched in exact arithmetic, in a process of its own. If it is not found within a second, numbers are
    asked for the verdict meanwhile: a search for a witness, then :func:`certify`. Every witness is checked with
    singular values of the robot's Jacobians, computed apart from the polynomials. Where the budget is spent, or a
    keyboard interrupt comes, what is known so far is the answer, with the branches that were not decided in
    ``locus.open``.

    Args:
        certificate: of this set, if there is one already.
        progress: called with the verdict where it is known before the locus is.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 3.1.

    Raises:
        UnknownNameError: algorithm, frame or joint. RangeError: fewer rows than joints, more task rows than joints, or
            a task that has full rank nowhere; a budget that is spent before the Jacobian is there.
    """
    began, spent = time.monotonic(), processor_seconds()
    wanted, added = checked("task", task), checked("constraints", constraints)
    checked_model(model)
    budget = Budget() if budget is None else validation.instance("budget", budget, Budget, "a Budget")
    if certificate is not None:
        validation.instance("certificate", certificate, RankCertificate, "a Certificate of certify")
    validation.function("progress", progress)
    budget.start()
    rows = (*wanted, *added)
    if not made_within(model, rows, budget.seconds):
        text = f"expected more: the exact Jacobian of {model.robot.nv} joints takes longer"
        raise RangeError("minutes", budget.minutes, text)
    search = budget.part(_SEARCH)
    found, certificate, done = _searched(
        model, wanted, added, algorithm, search, certificate=certificate, progress=progress
    )
    witness = None
    if certificate is not None and certificate.witness is not None:
        witness = certificate.witness
    elif found.verdict == UNDECIDED:
        witness = find_witness(model.robot, found, wanted, rows, model.configuration, budget)
    verdict = found.verdict
    if witness is not None:
        verdict = INCOMPLETE
    elif verdict == UNDECIDED:
        if done and _verdict(certificate) is None and budget.seconds > HEAD:
            certificate = _certified(model, wanted, added, budget, lambda: False) or certificate
        verdict = _verdict(certificate) or UNDECIDED
    return Analysis(
        model.robot.dof_names,
        found.exact,
        symbolic_jacobian(model, wanted),
        found.augmented,
        found.locus,
        found.algorithmic,
        verdict,
        witness,
        certificate,
        time.monotonic() - began,
        processor_seconds() - spent,
    )


def _searched(
    model: ExactModel,
    task: tuple[Rows, ...],
    added: tuple[Rows, ...],
    algorithm: str,
    budget: Budget,
    *,
    certificate: RankCertificate | None,
    progress: Callable[[str], None] | None,
) -> tuple[Loci, RankCertificate | None, bool]:
    """(loci, certificate if it was asked for, whether the search came to its end)."""
    done = False
    with LocusSearch(model, task, (*task, *added), algorithm, budget) as search:
        check_task(model.robot, task)
        try:
            if not search.wait(min(HEAD, budget.seconds)) and certificate is None:
                certificate = _certified(model, task, added, budget, lambda: search.done)
            decided = _verdict(certificate)
            if decided is not None and progress is not None and not search.done:
                progress(decided)
            if decided != STRICT:
                search.wait(budget.seconds)
            done = search.done
        except KeyboardInterrupt:
            search.interrupt()
        found = search.found()
    if not done and _verdict(certificate) == STRICT:
        found = Loci(found.exact, found.augmented, Locus(()), (), ())
    return found, certificate, done


def _certified(
    model: ExactModel, task: tuple[Rows, ...], added: tuple[Rows, ...], budget: Budget, ended: Callable[[], bool]
) -> RankCertificate | None:
    """What numbers say within the budget, beside the search of the locus; None where they do not take the robot."""
    workers = max(1, (os.cpu_count() or 1) - 1)
    minutes = max(_LEAST, budget.seconds / 60.0)
    try:
        return certify(model, task, added, minutes=minutes, workers=workers, ended=ended)
    except (UnsupportedJointError, RangeError, CompileError):
        return None


def _verdict(found: RankCertificate | None) -> str | None:
    """Of a certificate, in the words of :class:`Analysis`; None: it decides nothing."""
    if found is None:
        return None
    if found.verdict == COMPLETE:
        return STRICT if found.everywhere else COMPLETE
    return INCOMPLETE if found.verdict == INCOMPLETE else None


def find_witness(
    robot: Robot,
    found: Loci,
    task: Sequence[Rows],
    rows: Sequence[Rows],
    configuration: Callable[[Array], Array],
    budget: Budget,
) -> RankWitness | None:
    """The best of random points on the first branch that has one: its task is farthest from a loss of rank.

    Args:
        configuration: of the robot, from a number for each joint of the arithmetic that found the branches.
    """

    def work(report: Report) -> None:
        numeric, rng = NumericRows(robot), np.random.default_rng(0)
        for number, branch in enumerate(found.algorithmic):
            farthest = 0.0
            for _ in range(TRIES):
                point = real_point(found.exact.half, branch, rng)
                if point is None:
                    continue
                q = configuration(point)
                J_T, J_R = numeric.value(task, q), numeric.value(rows, q)
                if rank(J_T) < J_T.shape[0] or rank(J_R) == robot.nv:
                    continue
                sigma = singular_values(J_T)
                if sigma[-1] > farthest:
                    farthest = float(sigma[-1])
                    report((number, q, sigma, singular_values(J_R)))
            if farthest > 0.0:
                return

    with Child(work, max(budget.seconds, _AFTER)) as child:
        child.wait()
    if not child.reports:
        return None
    number, q, own, every = child.reports[-1]
    return RankWitness(q, own, every, found.algorithmic[number])
