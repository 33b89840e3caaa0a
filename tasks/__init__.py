"""Tasks and constraints: declarative objects, one idea a file (floor 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.tasks._stereographic import PlaneReference as PlaneReference
    from wbc.tasks.axis_align import AxisAlign as AxisAlign
    from wbc.tasks.axis_cone import AxisCone as AxisCone
    from wbc.tasks.base import (
        Bounds as Bounds,
        Constraint as Constraint,
        Form as Form,
        Input as Input,
        Item as Item,
        Row as Row,
        Rows as Rows,
        SacrificeOrder as SacrificeOrder,
        Task as Task,
        Values as Values,
        registry as registry,
    )
    from wbc.tasks.center_of_mass import CenterOfMass as CenterOfMass
    from wbc.tasks.damping import Damping as Damping
    from wbc.tasks.distance import Distance as Distance
    from wbc.tasks.divergent_component import DivergentComponent as DivergentComponent
    from wbc.tasks.drive_torque_limits import DriveTorqueLimits as DriveTorqueLimits
    from wbc.tasks.elbow import Elbow as Elbow
    from wbc.tasks.end_effector import EndEffector as EndEffector
    from wbc.tasks.expression import Expression as Expression
    from wbc.tasks.external_wrench import ExternalWrench as ExternalWrench
    from wbc.tasks.fixed import Fixed as Fixed
    from wbc.tasks.frame_velocity_limit import FrameVelocityLimit as FrameVelocityLimit
    from wbc.tasks.gaze_cone import GazeCone as GazeCone
    from wbc.tasks.hold import Hold as Hold
    from wbc.tasks.joint_coupling import JointCoupling as JointCoupling
    from wbc.tasks.joint_friction import JointFriction as JointFriction
    from wbc.tasks.joint_limits import JointLimits as JointLimits
    from wbc.tasks.limit import Limit as Limit
    from wbc.tasks.line_contact import LineContact as LineContact
    from wbc.tasks.look_at import LookAt as LookAt
    from wbc.tasks.manipulability import Manipulability as Manipulability
    from wbc.tasks.mechanism import Mechanism as Mechanism
    from wbc.tasks.momentum import Momentum as Momentum
    from wbc.tasks.moving_frame import MovingFrame as MovingFrame
    from wbc.tasks.obstacle import Obstacle as Obstacle
    from wbc.tasks.pitch_plane import PitchPlane as PitchPlane
    from wbc.tasks.pitch_plane_limit import PitchPlaneLimit as PitchPlaneLimit
    from wbc.tasks.point_contact import PointContact as PointContact
    from wbc.tasks.posture import Posture as Posture
    from wbc.tasks.relative_pose import RelativePose as RelativePose
    from wbc.tasks.rigid_grasp import RigidGrasp as RigidGrasp
    from wbc.tasks.rolling import Rolling as Rolling, Wheel as Wheel
    from wbc.tasks.rolling_contact import RollingContact as RollingContact
    from wbc.tasks.self_collision import SelfCollision as SelfCollision
    from wbc.tasks.sliding_contact import SlidingContact as SlidingContact
    from wbc.tasks.support_hull import support_planes as support_planes, support_polygon as support_polygon
    from wbc.tasks.support_region import SupportRegion as SupportRegion
    from wbc.tasks.surface_contact import SurfaceContact as SurfaceContact
    from wbc.tasks.torque_limits import TorqueLimits as TorqueLimits
    from wbc.tasks.workspace_box import WorkspaceBox as WorkspaceBox
    from wbc.tasks.workspace_polyhedron import WorkspacePolyhedron as WorkspacePolyhedron
    from wbc.tasks.wrench_sum import WrenchSum as WrenchSum
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
