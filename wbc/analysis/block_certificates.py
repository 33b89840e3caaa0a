"""``certify_blocks``: completeness of coordinates on a tree of arms, proved block by block by subdivision."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wbc import validation
from wbc.analysis.blocks import block_model, lift, parted_task, problem
from wbc.analysis.certificates.certificate import COMPLETE, INCOMPLETE, UNDECIDED, RankCertificate, certify
from wbc.analysis.certificates.weakest import RankWitness, descended, joint_values
from wbc.analysis.completeness import TRIES
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.jacobians.numeric import NumericRows, rank, singular_values
from wbc.analysis.jacobians.tree_joints import JointBlock, joint_blocks
from wbc.analysis.rows import Rows, checked
from wbc.errors import ShapeError
from wbc.validation import Array

#: Minutes that a block gets when the others have used up the time [min]
_LAST = 1e-6


@dataclass(frozen=True, eq=False)
class TreeCertificate:
    """What subdivision proved of a tree.

    Attributes:
        verdict: ``complete``, ``incomplete`` (see witness) or ``undecided`` (see left), of the whole robot.
        parted: whether the task falls into the blocks. If so, ``complete`` holds where no block is in its tube
            sigma_min(J_Tb) < eps_b; if not, at every configuration.
        blocks: each with its certificate, which those that are alike share. everywhere: no block needed a tube.
        left: part of the volume of all joints in which some block is not decided.
        eps: a witness has sigma_min(J_T) >= eps; 0 where none was looked for. witness, lost: of the whole robot, and
            the block that loses rank there. seconds: wall clock.
    """

    verdict: str
    parted: bool
    blocks: tuple[tuple[JointBlock, RankCertificate], ...]
    everywhere: bool
    left: float
    eps: float
    witness: RankWitness | None
    lost: JointBlock | None
    seconds: float


def certify_blocks(
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    *,
    part: float = 0.01,
    minutes: float = 30.0,
    workers: int | None = None,
    state: str | os.PathLike[str] | None = None,
    progress: Callable[[JointBlock, float], None] | None = None,
) -> TreeCertificate:
    """Completeness as :func:`certify` proves it, of a tree whose rows fall into blocks J_b as of ``analyse_blocks``:

        rank J_R = sum_b rank J_b,    so full rank of every J_b is full rank of J_R

    If the task falls into the same blocks, each has a tube of its own. If not (the task is both hands, the carrier's
    tip a constraint), each block is proved everywhere or not at all. Where a block loses rank, a configuration of the
    whole robot is looked for with sigma_min(J_T) >= eps, part of its maximum, checked by Pinocchio's Jacobians.

    Args:
        minutes: for all blocks together; each has an equal part of what is left. state: file name, to which each
            block adds that of its first joint.
        progress: called with a block and the decided part of its volume. Others: as of :func:`certify`.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 4.5, eqs. 4.46 to 4.48.

    Raises:
        RangeError: a row that leaves no blocks, see :func:`joint_blocks`. As :func:`certify` for each block.
    """
    began = time.monotonic()
    wanted, added = checked("task", task), checked("constraints", constraints)
    rows = (*wanted, *added)
    blocks = joint_blocks(checked_model(model).robot, rows)
    validation.function("progress", progress)
    part = validation.scalar("part", part, low=0.0, high=1.0, open_low=True)
    if state is not None and not validation.file_path("state", state).name:
        raise ShapeError("state", state, "expected the name of a file")
    minutes = validation.scalar("minutes", minutes, low=0.0, open_low=True, unit="min")
    parted = parted_task(model, wanted, blocks)
    found: list[tuple[JointBlock, ExactModel, RankCertificate]] = []
    known: dict[tuple[object, ...], RankCertificate] = {}
    for number, block in enumerate(blocks):
        alone = block_model(model, block)
        own = [r for r in block.rows if parted and any(r is t for t in wanted)]
        rest = [r for r in block.rows if not any(r is t for t in own)] or own
        key = problem(alone, own, rest)
        if key not in known:
            left = (minutes - (time.monotonic() - began) / 60.0) / (len(blocks) - number)
            within = None if progress is None else _of_block(progress, block)
            file = None if state is None else _file(validation.file_path("state", state), block)
            known[key] = certify(
                alone, own, rest, part=part, minutes=max(left, _LAST), workers=workers, state=file, progress=within
            )
        found.append((block, alone, known[key]))
    certificates = tuple((block, one) for block, _, one in found)
    bad = [(block, alone, one.witness) for block, alone, one in found if one.witness is not None]
    eps = part * _peak(model, wanted) if bad else 0.0
    witness, lost = _whole(model, wanted, rows, bad, eps)
    complete = all(one.verdict == COMPLETE for _, one in certificates)
    verdict = INCOMPLETE if witness is not None else COMPLETE if complete else UNDECIDED
    undecided = 1.0 - float(np.prod([1.0 - one.left for _, one in certificates]))
    everywhere = complete and all(one.everywhere for _, one in certificates)
    return TreeCertificate(
        verdict, parted, certificates, everywhere, undecided, eps, witness, lost, time.monotonic() - began
    )


def _of_block(progress: Callable[[JointBlock, float], None], block: JointBlock) -> Callable[[float], None]:
    return lambda share: progress(block, share)


def _file(state: Path, block: JointBlock) -> Path:
    return state.with_name(f"{state.stem}-{block.joints[0]}{state.suffix}")


def _peak(model: ExactModel, task: tuple[Rows, ...]) -> float:
    """The largest sigma_min(J_T) of the whole robot that a search finds."""
    numeric = NumericRows(model.robot)

    def cost(q: Array) -> Array:
        return np.array([-singular_values(numeric.value(task, model.configuration(at)))[-1] for at in q])

    return -float(descended(cost, model.robot.nv, np.random.default_rng(0), starts=400, steps=20)[1][0])


def _whole(
    model: ExactModel,
    task: tuple[Rows, ...],
    rows: tuple[Rows, ...],
    bad: Sequence[tuple[JointBlock, ExactModel, RankWitness]],
    eps: float,
) -> tuple[RankWitness | None, JointBlock | None]:
    """Of places of the other joints that for which the task of the whole robot is farthest from a loss of rank."""
    numeric = NumericRows(model.robot)
    for block, alone, witness in bad:
        lifted = lift(model, alone)
        best: RankWitness | None = None
        for _ in range(TRIES):
            q = lifted(joint_values(alone, witness.q))
            sigma, J_R = singular_values(numeric.value(task, q)), numeric.value(rows, q)
            if sigma[-1] >= eps and rank(J_R) < model.robot.nv and (best is None or sigma[-1] > best.task[-1]):
                best = RankWitness(q, sigma, singular_values(J_R))
        if best is not None:
            return best, block
    return None, None
