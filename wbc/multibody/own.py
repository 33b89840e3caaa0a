"""The part of Pinocchio's interface that this package has itself, by Pinocchio's names."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from wbc.extras import missing
from wbc.multibody import rotations as turns
from wbc.multibody.algorithms import (
    aba,
    centerOfMass,
    computeCentroidalMap,
    computeCentroidalMomentum,
    computeCoriolisMatrix,
    computeFrameJacobian,
    computeGeneralizedGravity,
    computeJointJacobians,
    computePotentialEnergy,
    computeTotalMass,
    crba,
    difference,
    forwardKinematics,
    framesForwardKinematics,
    getFrameAcceleration,
    getFrameClassicalAcceleration,
    getFrameJacobian,
    getFrameVelocity,
    getJointJacobian,
    integrate,
    interpolate,
    isNormalized,
    jacobianCenterOfMass,
    neutral,
    nonLinearEffects,
    normalize,
    rnea,
    updateFramePlacement,
    updateFramePlacements,
)
from wbc.multibody.joints import (
    JointModel,
    JointModelFreeFlyer,
    JointModelPlanar,
    JointModelPrismaticUnaligned,
    JointModelPX,
    JointModelPY,
    JointModelPZ,
    JointModelRevoluteUnaligned,
    JointModelRevoluteUnboundedUnaligned,
    JointModelRUBX,
    JointModelRUBY,
    JointModelRUBZ,
    JointModelRX,
    JointModelRY,
    JointModelRZ,
    JointModelSpherical,
)
from wbc.multibody.model import FrameOnJoint as Frame, FrameType, Model, ReferenceFrame, TreeData as Data
from wbc.multibody.rotations import Jexp3, exp3, log3, skew
from wbc.multibody.spatial import (
    SE3,
    AngleAxis,
    Inertia,
    Jexp6,
    Quaternion,
    SE3ToXYZQUAT,
    SpatialMotion as Motion,
    XYZQUATToSE3,
    exp6,
    log6,
    seed,
)

__all__ = [
    "SE3",
    "AngleAxis",
    "Convention",
    "Data",
    "Frame",
    "FrameType",
    "Inertia",
    "Jexp3",
    "Jexp6",
    "JointModel",
    "JointModelFreeFlyer",
    "JointModelPX",
    "JointModelPY",
    "JointModelPZ",
    "JointModelPlanar",
    "JointModelPrismaticUnaligned",
    "JointModelRUBX",
    "JointModelRUBY",
    "JointModelRUBZ",
    "JointModelRX",
    "JointModelRY",
    "JointModelRZ",
    "JointModelRevoluteUnaligned",
    "JointModelRevoluteUnboundedUnaligned",
    "JointModelSpherical",
    "Model",
    "Motion",
    "Quaternion",
    "ReferenceFrame",
    "SE3ToXYZQUAT",
    "XYZQUATToSE3",
    "aba",
    "centerOfMass",
    "computeCentroidalMap",
    "computeCentroidalMomentum",
    "computeCoriolisMatrix",
    "computeFrameJacobian",
    "computeGeneralizedGravity",
    "computeJointJacobians",
    "computePotentialEnergy",
    "computeTotalMass",
    "crba",
    "difference",
    "exp3",
    "exp6",
    "forwardKinematics",
    "framesForwardKinematics",
    "getFrameAcceleration",
    "getFrameClassicalAcceleration",
    "getFrameJacobian",
    "getFrameVelocity",
    "getJointJacobian",
    "integrate",
    "interpolate",
    "isNormalized",
    "jacobianCenterOfMass",
    "log3",
    "log6",
    "neutral",
    "nonLinearEffects",
    "normalize",
    "rnea",
    "rpy",
    "seed",
    "skew",
    "updateFramePlacement",
    "updateFramePlacements",
    "utils",
]

#: Stands where programs ask for the version of Pinocchio
__version__ = "none"

WORLD = ReferenceFrame.WORLD
LOCAL = ReferenceFrame.LOCAL
LOCAL_WORLD_ALIGNED = ReferenceFrame.LOCAL_WORLD_ALIGNED
Convention = SimpleNamespace(LOCAL=1, WORLD=0)
rpy = SimpleNamespace(rpyToMatrix=turns.rpy_matrix, matrixToRpy=turns.matrix_rpy)
utils = SimpleNamespace(rotate=turns.axis_turn)


def __getattr__(name: str) -> Any:
    """Names that only Pinocchio has.

    Raises:
        MissingPackageError: what needs Pinocchio, and the platform.
    """
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    raise missing("pinocchio", "pin", f"Pinocchio's {name}")
