"""Robots by name, from files, from models and from Denavit-Hartenberg rows; machines that walk on holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.robot.carried import carry
    from wbc.robot.geometry.convex_parts import ConvexParts
    from wbc.robot.geometry.link_shapes import convex_parts, fit_shapes
    from wbc.robot.loops import JointCurve, Loop, LoopError
    from wbc.robot.mujoco_joints import MujocoJoints
    from wbc.robot.pairs.collision_pairs import LinkPair, SelfPairs
    from wbc.robot.pairs.pairs_file import read_self_pairs, save_self_pairs
    from wbc.robot.sources.dh import DHRow
    from wbc.robots.catalogue import from_dh, load, names, table
    from wbc.robots.limb import BodyLimb, Limb
    from wbc.robots.margins import Margins
    from wbc.robots.operator_arms import OperatorArm, operator_arm
    from wbc.robots.pairs import find_self_pairs
    from wbc.robots.walker_arms import WalkerArm
    from wbc.robots.walker_data import TwoEndedData, WalkerData
    from wbc.robots.walker_masses import HoldRating, hold_rating, with_masses
    from wbc.robots.walker_robot import Walker, walker
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "BodyLimb",
    "ConvexParts",
    "DHRow",
    "HoldRating",
    "JointCurve",
    "Limb",
    "LinkPair",
    "Loop",
    "LoopError",
    "Margins",
    "MujocoJoints",
    "OperatorArm",
    "SelfPairs",
    "TwoEndedData",
    "Walker",
    "WalkerArm",
    "WalkerData",
    "carry",
    "convex_parts",
    "find_self_pairs",
    "fit_shapes",
    "from_dh",
    "hold_rating",
    "load",
    "names",
    "operator_arm",
    "read_self_pairs",
    "save_self_pairs",
    "table",
    "walker",
    "with_masses",
]


def __dir__() -> list[str]:
    return __all__
