"""Completeness of coordinates on a tree of arms, decided block by block."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.analysis.certificates.certificate import INCOMPLETE
from wbc.analysis.certificates.weakest import RankWitness
from wbc.analysis.completeness import find_witness
from wbc.analysis.jacobians.jacobian import symbolic_jacobian
from wbc.analysis.jacobians.model import ExactModel, checked_model
from wbc.analysis.jacobians.numeric import NumericRows, check_task
from wbc.analysis.jacobians.tree_joints import JointBlock, TreeJoints, joint_blocks
from wbc.analysis.loci.budget import Budget, processor_seconds
from wbc.analysis.loci.loci import LOOSE, STRICT, UNDECIDED, Loci, loci
from wbc.analysis.rows import Rows, checked
from wbc.multibody import pin
from wbc.robots import load
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class BlockAnalysis:
    """What one block does.

    Attributes:
        block: its joints and rows. model: the robot with all other joints locked. loci: of the block's rows.
        verdict: ``strict`` (never loses rank), ``loose`` (only where the part of the task in the block does),
            ``undecided`` (elsewhere: left to the whole robot).
    """

    block: JointBlock
    model: ExactModel
    loci: Loci
    verdict: str


@dataclass(frozen=True, eq=False)
class TreeAnalysis:
    """Rank analysis of one set on a tree.

    Attributes:
        shape: rows and joints of J_R. blocks: in the order of the joints. parted: whether the task falls into the
            blocks as well.
        verdict, witness: as those of :class:`Analysis`, of the whole robot. lost: the block that loses rank at the
            witness. seconds: by the clock. processor: processor time of all threads and processes [s].
    """

    shape: tuple[int, int]
    blocks: tuple[BlockAnalysis, ...]
    parted: bool
    verdict: str
    witness: RankWitness | None
    lost: JointBlock | None
    seconds: float
    processor: float


def analyse_blocks(
    model: ExactModel,
    task: Sequence[Rows],
    constraints: Sequence[Rows],
    *,
    algorithm: str = "sub_determinants",
    minutes: float = 30.0,
) -> TreeAnalysis:
    """Completeness as :func:`analyse` decides it, of a tree whose rows fall into blocks J_b:

        rank J_R = sum_b rank J_b,    S_R = union of the S_b

    Each block is a robot of its own, with all other joints locked, and its locus is found in exact arithmetic. If the
    task falls into the same blocks, so does the verdict. If not (the task is both hands, the carrier's tip a
    constraint), a block that never loses rank is strict, and on the branches of the others a configuration of the
    whole robot is looked for where the task has full rank; it is checked by singular values of the whole Jacobians.

    Args:
        minutes: by the clock, for all blocks together.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 4.5, eqs. 4.46 to 4.48.

    Raises:
        RangeError: a row that leaves no blocks, or a block with fewer rows than joints; see :func:`joint_blocks`. A
            task that has full rank nowhere.
        UnknownNameError: algorithm, frame or joint.
    """
    began, spent = time.monotonic(), processor_seconds()
    budget = Budget(minutes=minutes)
    budget.start()
    wanted, added = checked("task", task), checked("constraints", constraints)
    rows = (*wanted, *added)
    blocks = joint_blocks(checked_model(model).robot, rows)
    parted = parted_task(model, wanted, blocks)
    check_task(model.robot, wanted)
    known: dict[tuple[object, ...], Loci] = {}
    analysed = tuple(
        _analysed(model, block, wanted if parted else (), algorithm, known, budget.seconds / (len(blocks) - number))
        for number, block in enumerate(blocks)
    )
    verdicts = {one.verdict for one in analysed}
    witness: RankWitness | None = None
    lost: JointBlock | None = None
    for one in analysed:
        if one.verdict == UNDECIDED and witness is None:
            witness = find_witness(model.robot, one.loci, wanted, rows, lift(model, one.model), budget)
            lost = None if witness is None else one.block
    verdict = next(v for v in (UNDECIDED, LOOSE, STRICT) if v in verdicts)
    if witness is not None:
        verdict = INCOMPLETE
    shape = NumericRows(model.robot).value(rows, model.robot.neutral).shape
    seconds, processor = time.monotonic() - began, processor_seconds() - spent
    return TreeAnalysis((shape[0], shape[1]), analysed, parted, verdict, witness, lost, seconds, processor)


def parted_task(model: ExactModel, task: tuple[Rows, ...], blocks: Sequence[JointBlock]) -> bool:
    """Whether each row of the task, less what the task itself knows of carriers, lies in one block."""
    tree = TreeJoints(model.robot)
    known = tree.known(task)
    runs = [frozenset(tree.number(name) for name in block.joints) for block in blocks]
    return all(any(tree.joints_of(declared, known) <= run for run in runs) for declared in task)


def _analysed(
    model: ExactModel,
    block: JointBlock,
    task: tuple[Rows, ...],
    algorithm: str,
    known: dict[tuple[object, ...], Loci],
    seconds: float,
) -> BlockAnalysis:
    alone = block_model(model, block)
    own = [r for r in block.rows if any(r is t for t in task)]
    key = problem(alone, own, [r for r in block.rows if not any(r is t for t in own)])
    if key not in known:
        known[key] = loci(alone, own, block.rows, algorithm, Budget(minutes=max(seconds, 1e-3) / 60.0))
    return BlockAnalysis(block, alone, known[key], known[key].verdict)


def problem(alone: ExactModel, task: Sequence[Rows], rest: Sequence[Rows]) -> tuple[object, ...]:
    """What loci and certificates depend on: blocks that are alike, two arms on one body, share theirs."""
    J = symbolic_jacobian(alone, (*task, *rest))
    return tuple(alone.robot.model.nqs), len(task), tuple(str(p) for r in J.matrix for p in r)


def block_model(model: ExactModel, block: JointBlock) -> ExactModel:
    """The robot with every joint but those of a block locked at zero."""
    whole = model.robot.model
    locked = [j for j in range(1, whole.njoints) if str(whole.names[j]) not in block.joints]
    reduced = load(pin.buildReducedModel(whole, locked, pin.neutral(whole))) if locked else model.robot
    symbols = {name: float(value) for name, value in model.ring.symbols.items()}
    return ExactModel(reduced, symbols, approximate=model.approximate)


def lift(model: ExactModel, part: ExactModel) -> Callable[[Array], Array]:
    """Configurations of the whole robot from points of a block: the other joints are anywhere."""
    rng = np.random.default_rng(1)
    indices = [model.robot.dofs(str(name)).start for name in part.robot.model.names[1:]]

    def lifted(point: Array) -> Array:
        values = rng.uniform(-np.pi, np.pi, model.robot.nv)
        values[indices] = point
        return model.configuration(values)

    return lifted
