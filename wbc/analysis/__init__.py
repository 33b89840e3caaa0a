"""Rank analysis of task and constraint coordinates: symbolic Jacobians, loci, completeness. See docs/analysis.md."""

from __future__ import annotations

import warnings
from typing import Any

from wbc.analysis.block_certificates import TreeCertificate, certify_blocks
from wbc.analysis.blocks import BlockAnalysis, TreeAnalysis, analyse_blocks
from wbc.analysis.boxes import Counts
from wbc.analysis.branches import Branch
from wbc.analysis.budget import Budget
from wbc.analysis.certificate import RankCertificate, certify
from wbc.analysis.completeness import Analysis, Witness, analyse
from wbc.analysis.deficiency import Exact
from wbc.analysis.determinants import Determinant, factored_determinant
from wbc.analysis.half_angles import Relation, Value
from wbc.analysis.jacobian import Cost, SymbolicJacobian, symbolic_jacobian
from wbc.analysis.loci import ALGORITHMS
from wbc.analysis.locus import Locus
from wbc.analysis.model import ExactModel
from wbc.analysis.notation import Notation
from wbc.analysis.points import joint_roots
from wbc.analysis.published import PublishedSets, candidate_rows, published_sets
from wbc.analysis.rows import BodyRows, JointRows, PitchPlaneRows, Rows
from wbc.analysis.screen import Screened, screen
from wbc.analysis.singular_vectors import singular_vector_locus
from wbc.analysis.sub_determinants import sub_determinant_locus
from wbc.analysis.tree_joints import JointBlock, joint_blocks
from wbc.analysis.weakest import NumericWitness

__all__ = [
    "ALGORITHMS",
    "Analysis",
    "BlockAnalysis",
    "BodyRows",
    "Branch",
    "Budget",
    "Cost",
    "Counts",
    "Determinant",
    "Exact",
    "ExactModel",
    "JointBlock",
    "JointRows",
    "Locus",
    "Notation",
    "NumericWitness",
    "PitchPlaneRows",
    "PublishedSets",
    "RankCertificate",
    "Relation",
    "Rows",
    "Screened",
    "SymbolicJacobian",
    "TreeAnalysis",
    "TreeCertificate",
    "Value",
    "Witness",
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


def __getattr__(name: str) -> Any:
    if name != "Certificate":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn("Certificate is called RankCertificate now", DeprecationWarning, stacklevel=2)
    return RankCertificate
