"""Tasks and constraints: declarative objects, one idea a file (floor 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.tasks._stereographic import PlaneReference
    from wbc.tasks.axis_align import AxisAlign
    from wbc.tasks.axis_cone import AxisCone
    from wbc.tasks.base import Bounds, Constraint, Form, Input, Item, Row, Rows, SacrificeOrder, Task, Values, registry
    from wbc.tasks.center_of_mass import CenterOfMass
    from wbc.tasks.damping import Damping
    from wbc.tasks.distance import Distance
    from wbc.tasks.divergent_component import DivergentComponent
    from wbc.tasks.drive_torque_limits import DriveTorqueLimits
    from wbc.tasks.elbow import Elbow
    from wbc.tasks.end_effector import EndEffector
    from wbc.tasks.expression import Expression
    from wbc.tasks.external_wrench import ExternalWrench
    from wbc.tasks.fixed import Fixed
    from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
    from wbc.tasks.gaze_cone import GazeCone
    from wbc.tasks.hold import Hold
    from wbc.tasks.joint_coupling import JointCoupling
    from wbc.tasks.joint_friction import JointFriction
    from wbc.tasks.joint_limits import JointLimits
    from wbc.tasks.limit import Limit
    from wbc.tasks.line_contact import LineContact
    from wbc.tasks.look_at import LookAt
    from wbc.tasks.manipulability import Manipulability
    from wbc.tasks.mechanism import Mechanism
    from wbc.tasks.momentum import Momentum
    from wbc.tasks.moving_frame import MovingFrame
    from wbc.tasks.obstacle import Obstacle
    from wbc.tasks.pitch_plane import PitchPlane
    from wbc.tasks.pitch_plane_limit import PitchPlaneLimit
    from wbc.tasks.point_contact import PointContact
    from wbc.tasks.posture import Posture
    from wbc.tasks.relative_pose import RelativePose
    from wbc.tasks.rigid_grasp import RigidGrasp
    from wbc.tasks.rolling import Rolling, Wheel
    from wbc.tasks.rolling_contact import RollingContact
    from wbc.tasks.self_collision import SelfCollision
    from wbc.tasks.sliding_contact import SlidingContact
    from wbc.tasks.support_hull import support_planes, support_polygon
    from wbc.tasks.support_region import SupportRegion
    from wbc.tasks.surface_contact import SurfaceContact
    from wbc.tasks.torque_limits import TorqueLimits
    from wbc.tasks.workspace_box import WorkspaceBox
    from wbc.tasks.workspace_polyhedron import WorkspacePolyhedron
    from wbc.tasks.wrench_sum import WrenchSum
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "AxisAlign",
    "AxisCone",
    "Bounds",
    "CenterOfMass",
    "Constraint",
    "Damping",
    "Distance",
    "DivergentComponent",
    "DriveTorqueLimits",
    "Elbow",
    "EndEffector",
    "Expression",
    "ExternalWrench",
    "Fixed",
    "Form",
    "FrameVelocityLimit",
    "GazeCone",
    "Hold",
    "Input",
    "Item",
    "JointCoupling",
    "JointFriction",
    "JointLimits",
    "Limit",
    "LineContact",
    "LookAt",
    "Manipulability",
    "Mechanism",
    "Momentum",
    "MovingFrame",
    "Obstacle",
    "PitchPlane",
    "PitchPlaneLimit",
    "PlaneReference",
    "PointContact",
    "Posture",
    "RelativePose",
    "RigidGrasp",
    "Rolling",
    "RollingContact",
    "Row",
    "Rows",
    "SacrificeOrder",
    "SelfCollision",
    "SlidingContact",
    "SupportRegion",
    "SurfaceContact",
    "Task",
    "TorqueLimits",
    "Values",
    "Wheel",
    "WorkspaceBox",
    "WorkspacePolyhedron",
    "WrenchSum",
    "registry",
    "support_planes",
    "support_polygon",
]
