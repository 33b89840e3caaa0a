"""Robots by name, from files, from models and from Denavit-Hartenberg rows; machines that walk on holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.robot.carried import carry as carry
    from wbc.robot.geometry.convex_parts import ConvexParts as ConvexParts
    from wbc.robot.geometry.link_shapes import convex_parts as convex_parts, fit_shapes as fit_shapes
    from wbc.robot.loops import JointCurve as JointCurve, Loop as Loop, LoopError as LoopError
    from wbc.robot.mujoco_joints import MujocoJoints as MujocoJoints
    from wbc.robot.pairs.collision_pairs import LinkPair as LinkPair, SelfPairs as SelfPairs
    from wbc.robot.pairs.pairs_file import read_self_pairs as read_self_pairs, save_self_pairs as save_self_pairs
    from wbc.robot.sources.dh import DHRow as DHRow
    from wbc.robots.catalogue import from_dh as from_dh, load as load, names as names, table as table
    from wbc.robots.operator_arms import OperatorArm as OperatorArm, operator_arm as operator_arm
    from wbc.robots.pairs import find_self_pairs as find_self_pairs
    from wbc.robots.walker_arms import WalkerArm as WalkerArm
    from wbc.robots.walker_data import TwoEndedData as TwoEndedData, WalkerData as WalkerData
    from wbc.robots.walker_masses import (
        HoldRating as HoldRating,
        hold_rating as hold_rating,
        with_masses as with_masses,
    )
    from wbc.robots.walker_robot import Walker as Walker, walker as walker
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
