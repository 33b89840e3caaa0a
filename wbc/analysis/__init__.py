"""Rank analysis of task and constraint coordinates: symbolic Jacobians, loci, completeness. See docs/analysis.md."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.analysis.algebra.branches import LocusBranch as LocusBranch
    from wbc.analysis.algebra.deficiency import Exact as Exact
    from wbc.analysis.algebra.half_angles import Relation as Relation, Value as Value
    from wbc.analysis.algebra.locus import Locus as Locus
    from wbc.analysis.algebra.notation import Notation as Notation
    from wbc.analysis.algebra.points import joint_roots as joint_roots
    from wbc.analysis.block_certificates import TreeCertificate as TreeCertificate, certify_blocks as certify_blocks
    from wbc.analysis.blocks import (
        BlockAnalysis as BlockAnalysis,
        TreeAnalysis as TreeAnalysis,
        analyse_blocks as analyse_blocks,
    )
    from wbc.analysis.certificates.boxes import Counts as Counts
    from wbc.analysis.certificates.certificate import RankCertificate as RankCertificate, certify as certify
    from wbc.analysis.certificates.screen import Screened as Screened, screen as screen
    from wbc.analysis.certificates.weakest import RankWitness as RankWitness
    from wbc.analysis.completeness import Analysis as Analysis, analyse as analyse
    from wbc.analysis.jacobians.jacobian import (
        Cost as Cost,
        SymbolicJacobian as SymbolicJacobian,
        symbolic_jacobian as symbolic_jacobian,
    )
    from wbc.analysis.jacobians.model import ExactModel as ExactModel
    from wbc.analysis.jacobians.tree_joints import JointBlock as JointBlock, joint_blocks as joint_blocks
    from wbc.analysis.loci.budget import Budget as Budget
    from wbc.analysis.loci.determinants import Determinant as Determinant, factored_determinant as factored_determinant
    from wbc.analysis.loci.loci import ALGORITHMS as ALGORITHMS
    from wbc.analysis.loci.singular_vectors import singular_vector_locus as singular_vector_locus
    from wbc.analysis.loci.sub_determinants import sub_determinant_locus as sub_determinant_locus
    from wbc.analysis.published import (
        PublishedSets as PublishedSets,
        candidate_rows as candidate_rows,
        published_sets as published_sets,
    )
    from wbc.analysis.rows import (
        BodyRows as BodyRows,
        JointRows as JointRows,
        PitchPlaneRows as PitchPlaneRows,
        Rows as Rows,
    )
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
