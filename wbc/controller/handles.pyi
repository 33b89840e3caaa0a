"""Run-time values of every class of items, from their declarations; `make docs` writes this file."""

from collections.abc import Mapping
from typing import Any, overload

from wbc.controller.handle import Handle
from wbc.stack.declaration import Declaration
from wbc.tasks._contact import ContactForce
from wbc.tasks.axis_align import AxisAlign
from wbc.tasks.axis_cone import AxisCone
from wbc.tasks.base import Item
from wbc.tasks.center_of_mass import CenterOfMass
from wbc.tasks.damping import Damping
from wbc.tasks.distance import Distance
from wbc.tasks.divergent_component import DivergentComponent
from wbc.tasks.drive_torque_limits import DriveTorqueLimits
from wbc.tasks.elbow import Elbow
from wbc.tasks.end_effector import EndEffector
from wbc.tasks.external_wrench import ExternalWrench
from wbc.tasks.fixed import Fixed
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
from wbc.tasks.gaze_cone import GazeCone
from wbc.tasks.hold import Hold
from wbc.tasks.joint_coupling import JointCoupling
from wbc.tasks.joint_friction import JointFriction
from wbc.tasks.joint_limits import JointLimits
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
from wbc.tasks.rolling import Rolling
from wbc.tasks.rolling_contact import RollingContact
from wbc.tasks.self_collision import SelfCollision
from wbc.tasks.sliding_contact import SlidingContact
from wbc.tasks.support_region import SupportRegion
from wbc.tasks.surface_contact import SurfaceContact
from wbc.tasks.torque_limits import TorqueLimits
from wbc.tasks.workspace_box import WorkspaceBox
from wbc.tasks.workspace_polyhedron import WorkspacePolyhedron
from wbc.tasks.wrench_sum import WrenchSum

class AxisAlignHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class AxisConeHandle(Handle):
    direction: Any
    direction_rate: Any
    half_angle: float
    half_angle_rate: Any
    price: float
    rate: float

class CenterOfMassHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class DampingHandle(Handle):
    gain: float
    weight: float
    stiffness: float
    damping: float

class DistanceHandle(Handle):
    target: Any
    feedforward: Any
    point: Any
    point_velocity: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class DivergentComponentHandle(Handle):
    target: Any
    feedforward: Any
    gain: float
    omega: float
    weight: float
    stiffness: float
    damping: float
    acceleration: Any

class DriveTorqueLimitsHandle(Handle):
    scale: Any
    torque: Any
    price: float

class ElbowHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class EndEffectorHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class ExternalWrenchHandle(Handle):
    wrench: Any
    price: float
    rate: float

class FixedHandle(Handle):
    price: float

class FrameVelocityLimitHandle(Handle):
    linear: Any
    angular: Any
    price: float

class GazeConeHandle(Handle):
    point: Any
    point_velocity: Any
    half_angle: float
    half_angle_rate: Any
    price: float
    rate: float

class HoldHandle(Handle):
    target: Any
    gain: float
    price: float
    rate: float

class JointCouplingHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class JointFrictionHandle(Handle):
    viscous: Any
    coulomb: Any
    slow: float
    price: float
    rate: float

class JointLimitsHandle(Handle):
    velocity_scale: Any
    return_rate: float
    price: float

class LineContactHandle(Handle):
    target: Any
    gain: Any
    friction: float
    least: float
    most: float
    price: float
    rate: float

class LookAtHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class ManipulabilityHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class MechanismHandle(Handle):
    gain: Any
    price: float
    rate: float

class MomentumHandle(Handle):
    target: Any
    lag: Any
    weight: float
    gain: float
    stiffness: float
    damping: float

class ObstacleHandle(Handle):
    pose: Any
    velocity: Any
    margin: float
    price: float
    rate: float
    distance: Any
    drift: Any
    line: Any
    side: Any

class PitchPlaneHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class PitchPlaneLimitHandle(Handle):
    price: float
    rate: float

class PointContactHandle(Handle):
    target: Any
    gain: Any
    friction: float
    least: float
    most: float
    price: float
    rate: float

class PostureHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class RelativePoseHandle(Handle):
    target: Any
    feedforward: Any
    at: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any

class RigidGraspHandle(Handle):
    target: Any
    gain: Any
    force: Any
    torque: Any
    price: float
    rate: float

class RollingHandle(Handle):
    ground: Any
    gain: float
    price: float
    rate: float

class RollingContactHandle(Handle):
    target: Any
    gain: Any
    friction: float
    least: float
    most: float
    price: float
    rate: float

class SelfCollisionHandle(Handle):
    margin: float
    price: float
    rate: float
    distance: Any
    drift: Any
    line: Any
    side: Any

class SlidingContactHandle(Handle):
    target: Any
    gain: Any
    friction: float
    least: float
    most: float
    slow: float
    price: float
    rate: float

class SupportRegionHandle(Handle):
    normals: Any
    offsets: Any
    price: float
    rate: float

class SurfaceContactHandle(Handle):
    target: Any
    gain: Any
    friction: float
    least: float
    most: float
    price: float
    rate: float

class TorqueLimitsHandle(Handle):
    scale: Any
    slew: Any
    last: Any
    price: float

class WorkspaceBoxHandle(Handle):
    lower: Any
    upper: Any
    lower_rate: Any
    upper_rate: Any
    price: float
    rate: float

class WorkspacePolyhedronHandle(Handle):
    offsets: Any
    offsets_rate: Any
    pose: Any
    velocity: Any
    price: float
    rate: float

class WrenchSumHandle(Handle):
    target: Any
    point: Any
    price: float
    rate: float

class ContactForceHandle(Handle):
    target: Any
    measured: Any
    feedback: Any
    weight: float
    gain: float
    stiffness: float
    damping: float

class MovingFrameHandle(Handle):
    pose: Any
    twist: Any
    acceleration: Any
    price: float
    rate: float

class NamedHandle(Handle):
    target: Any
    feedforward: Any
    weight: float
    gain: float
    stiffness: float
    damping: float
    acceleration: Any
    direction: Any
    direction_rate: Any
    half_angle: float
    half_angle_rate: Any
    price: float
    rate: float
    point: Any
    point_velocity: Any
    omega: float
    scale: Any
    torque: Any
    wrench: Any
    linear: Any
    angular: Any
    viscous: Any
    coulomb: Any
    slow: float
    velocity_scale: Any
    return_rate: float
    friction: float
    least: float
    most: float
    lag: Any
    pose: Any
    velocity: Any
    margin: float
    distance: Any
    drift: Any
    line: Any
    side: Any
    at: Any
    force: Any
    ground: Any
    normals: Any
    offsets: Any
    slew: Any
    last: Any
    lower: Any
    upper: Any
    lower_rate: Any
    upper_rate: Any
    offsets_rate: Any
    measured: Any
    feedback: Any
    twist: Any

class Handles:
    def __init__(self, handles: Mapping[str, Handle], stack: Declaration) -> None: ...
    @overload
    def __getitem__(self, item: str) -> NamedHandle: ...
    @overload
    def __getitem__(self, item: AxisAlign) -> AxisAlignHandle: ...
    @overload
    def __getitem__(self, item: AxisCone) -> AxisConeHandle: ...
    @overload
    def __getitem__(self, item: CenterOfMass) -> CenterOfMassHandle: ...
    @overload
    def __getitem__(self, item: Damping) -> DampingHandle: ...
    @overload
    def __getitem__(self, item: Distance) -> DistanceHandle: ...
    @overload
    def __getitem__(self, item: DivergentComponent) -> DivergentComponentHandle: ...
    @overload
    def __getitem__(self, item: DriveTorqueLimits) -> DriveTorqueLimitsHandle: ...
    @overload
    def __getitem__(self, item: Elbow) -> ElbowHandle: ...
    @overload
    def __getitem__(self, item: EndEffector) -> EndEffectorHandle: ...
    @overload
    def __getitem__(self, item: ExternalWrench) -> ExternalWrenchHandle: ...
    @overload
    def __getitem__(self, item: Fixed) -> FixedHandle: ...
    @overload
    def __getitem__(self, item: FrameVelocityLimit) -> FrameVelocityLimitHandle: ...
    @overload
    def __getitem__(self, item: GazeCone) -> GazeConeHandle: ...
    @overload
    def __getitem__(self, item: Hold) -> HoldHandle: ...
    @overload
    def __getitem__(self, item: JointCoupling) -> JointCouplingHandle: ...
    @overload
    def __getitem__(self, item: JointFriction) -> JointFrictionHandle: ...
    @overload
    def __getitem__(self, item: JointLimits) -> JointLimitsHandle: ...
    @overload
    def __getitem__(self, item: LineContact) -> LineContactHandle: ...
    @overload
    def __getitem__(self, item: LookAt) -> LookAtHandle: ...
    @overload
    def __getitem__(self, item: Manipulability) -> ManipulabilityHandle: ...
    @overload
    def __getitem__(self, item: Mechanism) -> MechanismHandle: ...
    @overload
    def __getitem__(self, item: Momentum) -> MomentumHandle: ...
    @overload
    def __getitem__(self, item: Obstacle) -> ObstacleHandle: ...
    @overload
    def __getitem__(self, item: PitchPlane) -> PitchPlaneHandle: ...
    @overload
    def __getitem__(self, item: PitchPlaneLimit) -> PitchPlaneLimitHandle: ...
    @overload
    def __getitem__(self, item: PointContact) -> PointContactHandle: ...
    @overload
    def __getitem__(self, item: Posture) -> PostureHandle: ...
    @overload
    def __getitem__(self, item: RelativePose) -> RelativePoseHandle: ...
    @overload
    def __getitem__(self, item: RigidGrasp) -> RigidGraspHandle: ...
    @overload
    def __getitem__(self, item: Rolling) -> RollingHandle: ...
    @overload
    def __getitem__(self, item: RollingContact) -> RollingContactHandle: ...
    @overload
    def __getitem__(self, item: SelfCollision) -> SelfCollisionHandle: ...
    @overload
    def __getitem__(self, item: SlidingContact) -> SlidingContactHandle: ...
    @overload
    def __getitem__(self, item: SupportRegion) -> SupportRegionHandle: ...
    @overload
    def __getitem__(self, item: SurfaceContact) -> SurfaceContactHandle: ...
    @overload
    def __getitem__(self, item: TorqueLimits) -> TorqueLimitsHandle: ...
    @overload
    def __getitem__(self, item: WorkspaceBox) -> WorkspaceBoxHandle: ...
    @overload
    def __getitem__(self, item: WorkspacePolyhedron) -> WorkspacePolyhedronHandle: ...
    @overload
    def __getitem__(self, item: WrenchSum) -> WrenchSumHandle: ...
    @overload
    def __getitem__(self, item: ContactForce) -> ContactForceHandle: ...
    @overload
    def __getitem__(self, item: MovingFrame) -> MovingFrameHandle: ...
    @overload
    def __getitem__(self, item: Item) -> Any: ...
    def __contains__(self, item: object) -> bool: ...
