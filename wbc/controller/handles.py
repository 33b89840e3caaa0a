"""Typed handles: which run-time values the items of each class have, for editors, type checkers and ``dir``.

    hand = wbc.tasks.EndEffector("panda_hand_tcp")
    controller = wbc.Stack(robot, dt=0.005).add(hand, name="hand").compile()
    controller[hand].target = pose        # a FollowerHandle
    controller["hand"].target = pose      # the same handle; the checker knows only that it is one of these classes

A misspelt value is an error of the type checker in both, and an :class:`UnknownValueError` when it runs. Values that an
item of the user's own declares pass the checker through the item; through its name they are set and read with
:meth:`Handle.set` and :meth:`Handle.get`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, overload

from wbc.controller.handle import Handle
from wbc.errors import DuplicateNameError, UnknownNameError
from wbc.stack.declaration import Declaration
from wbc.tasks import (
    AxisAlign,
    AxisCone,
    CenterOfMass,
    Damping,
    Distance,
    DivergentComponent,
    DriveTorqueLimits,
    Elbow,
    EndEffector,
    ExternalWrench,
    Fixed,
    FrameVelocityLimit,
    GazeCone,
    Hold,
    JointCoupling,
    JointFriction,
    JointLimits,
    LineContact,
    LookAt,
    Manipulability,
    Mechanism,
    Momentum,
    MovingFrame,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    PointContact,
    Posture,
    RelativePose,
    RigidGrasp,
    Rolling,
    RollingContact,
    SelfCollision,
    SlidingContact,
    SupportRegion,
    SurfaceContact,
    TorqueLimits,
    WorkspaceBox,
    WorkspacePolyhedron,
    WrenchSum,
)
from wbc.tasks._contact import ContactForce
from wbc.tasks.base import Item


class TaskHandle(Handle):
    """Of every task; ``stiffness`` and ``damping`` in place of ``gain`` where accelerations are commanded."""

    weight: float
    gain: float
    stiffness: float
    damping: float


class ContactForceHandle(TaskHandle):
    """Of the task for the wrench of a contact."""

    target: Any
    measured: Any
    feedback: float


class DivergentComponentHandle(TaskHandle):
    """Of :class:`DivergentComponent`."""

    target: Any
    feedforward: Any
    omega: float


class FollowerHandle(TaskHandle):
    """Of tasks that follow a target; ``acceleration`` where accelerations are commanded."""

    target: Any
    feedforward: Any
    acceleration: Any


class DistanceHandle(FollowerHandle):
    """Of :class:`Distance`."""

    point: Any
    point_velocity: Any


class RelativePoseHandle(FollowerHandle):
    """Of :class:`RelativePose`."""

    at: Any


class MomentumHandle(TaskHandle):
    """Of :class:`Momentum`."""

    lag: Any
    target: Any


class ConstraintHandle(Handle):
    """Of every constraint; ``price``: of a soft one."""

    price: float


class HoldHandle(ConstraintHandle):
    """Of equalities that are corrected with a gain; ``rate`` where accelerations are commanded."""

    gain: float
    rate: float
    target: Any


class ContactHandle(HoldHandle):
    """Of contacts: what they bear."""

    force: Any
    torque: Any
    friction: float
    least: float
    most: float
    slow: float


class ExternalWrenchHandle(ConstraintHandle):
    """Of :class:`ExternalWrench`."""

    wrench: Any


class JointFrictionHandle(ConstraintHandle):
    """Of :class:`JointFriction`."""

    viscous: Any
    coulomb: Any
    slow: float


class TorqueLimitsHandle(ConstraintHandle):
    """Of :class:`TorqueLimits`."""

    scale: float
    slew: Any
    last: Any


class DriveTorqueLimitsHandle(ConstraintHandle):
    """Of :class:`DriveTorqueLimits`."""

    scale: float
    torque: Any


class WrenchSumHandle(ConstraintHandle):
    """Of :class:`WrenchSum`."""

    target: Any
    point: Any


class RollingHandle(ConstraintHandle):
    """Of :class:`Rolling`."""

    gain: float
    ground: Any


class JointLimitsHandle(ConstraintHandle):
    """Of :class:`JointLimits`."""

    velocity_scale: float
    return_rate: float


class FrameVelocityHandle(ConstraintHandle):
    """Of :class:`FrameVelocityLimit`."""

    linear: Any
    angular: Any


class MarginHandle(ConstraintHandle):
    """Of constraints with margins."""

    rate: float


class SupportRegionHandle(MarginHandle):
    """Of :class:`SupportRegion`."""

    normals: Any
    offsets: Any


class ConeHandle(MarginHandle):
    """Of :class:`AxisCone` and :class:`GazeCone`."""

    half_angle: float
    half_angle_rate: float


class AxisConeHandle(ConeHandle):
    """Of :class:`AxisCone`."""

    direction: Any
    direction_rate: Any


class GazeConeHandle(ConeHandle):
    """Of :class:`GazeCone`."""

    point: Any
    point_velocity: Any


class ClearanceHandle(MarginHandle):
    """Of :class:`SelfCollision` and :class:`Obstacle`, with what is measured in every tick where shapes are meshes."""

    margin: float
    distance: Any
    drift: Any
    line: Any
    side: Any


class ObstacleHandle(ClearanceHandle):
    """Of :class:`Obstacle`."""

    pose: Any
    velocity: Any


class BoxHandle(MarginHandle):
    """Of :class:`WorkspaceBox`."""

    lower: Any
    lower_rate: Any
    upper: Any
    upper_rate: Any


class PolyhedronHandle(MarginHandle):
    """Of :class:`WorkspacePolyhedron`."""

    offsets: Any
    offsets_rate: Any
    pose: Any
    velocity: Any


class MovingFrameHandle(ConstraintHandle):
    """Of :class:`MovingFrame`."""

    pose: Any
    twist: Any
    acceleration: Any


if TYPE_CHECKING:

    class NamedHandle(
        DistanceHandle,
        RelativePoseHandle,
        MomentumHandle,
        ContactHandle,
        RollingHandle,
        JointLimitsHandle,
        FrameVelocityHandle,
        AxisConeHandle,
        GazeConeHandle,
        ObstacleHandle,
        BoxHandle,
        PolyhedronHandle,
        MovingFrameHandle,
        ExternalWrenchHandle,
        JointFrictionHandle,
        TorqueLimitsHandle,
        DriveTorqueLimitsHandle,
        WrenchSumHandle,
        SupportRegionHandle,
        DivergentComponentHandle,
        ContactForceHandle,
    ):
        """Of an item that is known by its name only: all values that items of this package have."""


_Follower = (
    AxisAlign | CenterOfMass | Elbow | EndEffector | JointCoupling | LookAt | Manipulability | PitchPlane | Posture
)

#: The handle of each class of items, and of those that are made from it; others have a plain one
KINDS: dict[type[Item], type[Handle]] = {
    **dict.fromkeys(_Follower.__args__, FollowerHandle),
    Distance: DistanceHandle,
    RelativePose: RelativePoseHandle,
    Momentum: MomentumHandle,
    Damping: TaskHandle,
    ContactForce: ContactForceHandle,
    Hold: HoldHandle,
    Mechanism: HoldHandle,
    RigidGrasp: ContactHandle,
    PointContact: ContactHandle,
    SurfaceContact: ContactHandle,
    LineContact: ContactHandle,
    SlidingContact: ContactHandle,
    RollingContact: ContactHandle,
    WrenchSum: WrenchSumHandle,
    SupportRegion: SupportRegionHandle,
    DriveTorqueLimits: DriveTorqueLimitsHandle,
    DivergentComponent: DivergentComponentHandle,
    ExternalWrench: ExternalWrenchHandle,
    JointFriction: JointFrictionHandle,
    TorqueLimits: TorqueLimitsHandle,
    Rolling: RollingHandle,
    Fixed: ConstraintHandle,
    JointLimits: JointLimitsHandle,
    FrameVelocityLimit: FrameVelocityHandle,
    AxisCone: AxisConeHandle,
    GazeCone: GazeConeHandle,
    PitchPlaneLimit: MarginHandle,
    SelfCollision: ClearanceHandle,
    Obstacle: ObstacleHandle,
    WorkspaceBox: BoxHandle,
    WorkspacePolyhedron: PolyhedronHandle,
    MovingFrame: MovingFrameHandle,
}


def kind_of(item: Item) -> type[Handle]:
    """The class of an item's handle."""
    return next((KINDS[base] for base in type(item).__mro__ if base in KINDS), Handle)


class Handles:
    """Run-time values of the items of a stack, by name or by the item itself as it was added."""

    def __init__(self, handles: Mapping[str, Handle], stack: Declaration) -> None:
        self._handles = handles
        self._names: dict[int, list[str]] = {}
        for entry in stack.entries:
            self._names.setdefault(id(entry.added or entry.item), []).append(entry.name)

    @overload
    def __getitem__(self, item: str) -> NamedHandle: ...
    @overload
    def __getitem__(self, item: Distance) -> DistanceHandle: ...
    @overload
    def __getitem__(self, item: RelativePose) -> RelativePoseHandle: ...
    @overload
    def __getitem__(self, item: Momentum) -> MomentumHandle: ...
    @overload
    def __getitem__(self, item: Damping) -> TaskHandle: ...
    @overload
    def __getitem__(self, item: _Follower) -> FollowerHandle: ...
    @overload
    def __getitem__(self, item: Hold | Mechanism) -> HoldHandle: ...
    @overload
    def __getitem__(
        self, item: RigidGrasp | PointContact | SurfaceContact | LineContact | SlidingContact | RollingContact
    ) -> ContactHandle: ...
    @overload
    def __getitem__(self, item: WrenchSum) -> WrenchSumHandle: ...
    @overload
    def __getitem__(self, item: SupportRegion) -> SupportRegionHandle: ...
    @overload
    def __getitem__(self, item: DivergentComponent) -> DivergentComponentHandle: ...
    @overload
    def __getitem__(self, item: ExternalWrench) -> ExternalWrenchHandle: ...
    @overload
    def __getitem__(self, item: JointFriction) -> JointFrictionHandle: ...
    @overload
    def __getitem__(self, item: TorqueLimits) -> TorqueLimitsHandle: ...
    @overload
    def __getitem__(self, item: DriveTorqueLimits) -> DriveTorqueLimitsHandle: ...
    @overload
    def __getitem__(self, item: ContactForce) -> ContactForceHandle: ...
    @overload
    def __getitem__(self, item: Rolling) -> RollingHandle: ...
    @overload
    def __getitem__(self, item: Fixed) -> ConstraintHandle: ...
    @overload
    def __getitem__(self, item: JointLimits) -> JointLimitsHandle: ...
    @overload
    def __getitem__(self, item: FrameVelocityLimit) -> FrameVelocityHandle: ...
    @overload
    def __getitem__(self, item: AxisCone) -> AxisConeHandle: ...
    @overload
    def __getitem__(self, item: GazeCone) -> GazeConeHandle: ...
    @overload
    def __getitem__(self, item: PitchPlaneLimit) -> MarginHandle: ...
    @overload
    def __getitem__(self, item: Obstacle) -> ObstacleHandle: ...
    @overload
    def __getitem__(self, item: SelfCollision) -> ClearanceHandle: ...
    @overload
    def __getitem__(self, item: WorkspaceBox) -> BoxHandle: ...
    @overload
    def __getitem__(self, item: WorkspacePolyhedron) -> PolyhedronHandle: ...
    @overload
    def __getitem__(self, item: MovingFrame) -> MovingFrameHandle: ...
    @overload
    def __getitem__(self, item: Item) -> Any: ...
    def __getitem__(self, item: str | Item) -> Any:
        """The handle of an item.

        Raises:
            UnknownNameError: no item of that name, or an item that was not added. DuplicateNameError: it was added more
                than once, so that its name has to say which is meant.
        """
        if isinstance(item, Item):
            names = self._names.get(id(item), [])
            if len(names) > 1:
                reason = f"is in the stack {len(names)} times, as {', '.join(names)}: say which by its name"
                raise DuplicateNameError("item", type(item).__name__, reason)
            if not names:
                alike = [name for name, handle in self._handles.items() if type(handle) is kind_of(item)]
                raise UnknownNameError("item", type(item).__name__, alike or self._handles)
            return self._handles[names[0]]
        try:
            return self._handles[item]
        except (KeyError, TypeError):
            raise UnknownNameError("item", item, self._handles) from None

    def __contains__(self, item: object) -> bool:
        return id(item) in self._names if isinstance(item, Item) else isinstance(item, str) and item in self._handles
