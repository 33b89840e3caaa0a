"""Rank analysis of task and constraint coordinates: symbolic Jacobians, loci, completeness. See docs/analysis.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.analysis.algebra.branches import LocusBranch
    from wbc.analysis.algebra.deficiency import Exact
    from wbc.analysis.algebra.half_angles import Relation, Value
    from wbc.analysis.algebra.locus import Locus
    from wbc.analysis.algebra.notation import Notation
    from wbc.analysis.algebra.points import joint_roots
    from wbc.analysis.block_certificates import TreeCertificate, certify_blocks
    from wbc.analysis.blocks import BlockAnalysis, TreeAnalysis, analyse_blocks
    from wbc.analysis.certificates.boxes import Counts
    from wbc.analysis.certificates.certificate import RankCertificate, certify
    from wbc.analysis.certificates.screen import Screened, screen
    from wbc.analysis.certificates.weakest import NumericWitness
    from wbc.analysis.completeness import Analysis, RankWitness, analyse
    from wbc.analysis.jacobians.jacobian import Cost, SymbolicJacobian, symbolic_jacobian
    from wbc.analysis.jacobians.model import ExactModel
    from wbc.analysis.jacobians.tree_joints import JointBlock, joint_blocks
    from wbc.analysis.loci.budget import Budget
    from wbc.analysis.loci.determinants import Determinant, factored_determinant
    from wbc.analysis.loci.loci import ALGORITHMS
    from wbc.analysis.loci.singular_vectors import singular_vector_locus
    from wbc.analysis.loci.sub_determinants import sub_determinant_locus
    from wbc.analysis.published import PublishedSets, candidate_rows, published_sets
    from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows, Rows
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "ALGORITHMS",
    "Analysis",
    "BlockAnalysis",
    "BodyRows",
    "Budget",
    "Cost",
    "Counts",
    "Determinant",
    "Exact",
    "ExactModel",
    "JointBlock",
    "JointRows",
    "Locus",
    "LocusBranch",
    "Notation",
    "NumericWitness",
    "PitchPlaneRows",
    "PublishedSets",
    "RankCertificate",
    "RankWitness",
    "Relation",
    "Rows",
    "Screened",
    "SymbolicJacobian",
    "TreeAnalysis",
    "TreeCertificate",
    "Value",
    "analyse",
    "analyse_blocks",
    "candidate_rows",
    "certify",
    "certify_blocks",
    "factored_determinant",
    "joint_blocks",
    "joint_roots",
    "published_sets",
    "screen",
    "singular_vector_locus",
    "sub_determinant_locus",
    "symbolic_jacobian",
]


def __dir__() -> list[str]:
    return __all__
