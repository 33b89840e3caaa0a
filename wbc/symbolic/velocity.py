"""Velocities and bias accelerations of bodies and frames, by recursion in body axes.

For each body, in its own axes: angular velocity w, velocity v and acceleration a of its origin, angular
acceleration alpha, and Omega = [alpha]x + [w]x[w]x, with which any of its points p moves at v + w x p and
accelerates at a + Omega p (Luh, Walker, Paul 1980). The kernels state the steps.
"""

from __future__ import annotations

import casadi as ca

from wbc.errors import UnknownNameError
from wbc.symbolic import kernels
from wbc.symbolic.kinematics import REFERENCES, Kinematics

#: Kinds of acceleration: ``classical`` is that of the material point, d^2p/dt^2; ``spatial`` is the rate of the
#: twist as a vector of se(3), classical - w x v (Featherstone 2008, section 2.11).
KINDS = ("classical", "spatial")

_ZERO = ca.SX(3, 1)


def _pair(twist: ca.SX) -> tuple[ca.SX, ca.SX]:
    """(angular, linear) of a 6-vector (linear; angular)."""
    return twist[3:], twist[:3]


class AccelerationField:
    """Classical accelerations of all bodies for one joint acceleration and one acceleration of the root.

    Args:
        motion: the velocities.
        joint_acceleration: nv numbers, or None for zero.
        root: acceleration of the world frame, 3 numbers (minus gravity for dynamics), or None for zero.
        spins: another field with the same joint acceleration, whose angular part is then shared.
    """

    def __init__(
        self,
        motion: Velocities,
        joint_acceleration: ca.SX | None = None,
        root: ca.SX | None = None,
        spins: AccelerationField | None = None,
    ) -> None:
        self._motion = motion
        self._given = joint_acceleration
        self._shared = spins
        self._angular: dict[int, tuple[ca.SX, ca.SX]] = {0: (_ZERO, ca.SX(3, 3))}
        self._linear: dict[int, ca.SX] = {0: _ZERO if root is None else root}
        self._rates: dict[int, tuple[ca.SX, ca.SX]] = {}

    def joint_rate(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(angular, linear) rate of the joint's twist components, S dv/dt + dS/dt v."""
        known = self._rates.get(joint)
        if known is None:
            kin = self._motion.kinematics
            columns = kin.joint_columns(joint)
            rate = kin.symbolic(joint).bias(kin.joint_q(joint), self._motion.rates[columns])
            angular, linear = _pair(rate)
            if self._given is not None:
                step = kernels.joint_velocity(columns.stop - columns.start)
                turn, slide = step(*kin.joint_subspace(joint), self._given[columns])
                angular, linear = angular + turn, linear + slide
            known = self._rates[joint] = (angular, linear)
        return known

    def angular(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(alpha, Omega) of body ``joint``."""
        if self._shared is not None:
            return self._shared.angular(joint)
        known = self._angular.get(joint)
        if known is None:
            motion, kin = self._motion, self._motion.kinematics
            alpha, _ = self.angular(kin.parents[joint])
            rotation = kin.local_pose(joint).rotation
            spin, _ = motion.joint_velocity(joint)
            step = kernels.spin_step()
            known = step(rotation, alpha, motion.body(joint)[0], spin, self.joint_rate(joint)[0])
            self._angular[joint] = known
        return known

    def linear(self, joint: int) -> ca.SX:
        """Acceleration of the origin of body ``joint``."""
        known = self._linear.get(joint)
        if known is None:
            motion, kin = self._motion, self._motion.kinematics
            parent, pose = kin.parents[joint], kin.local_pose(joint)
            spin, slide = motion.joint_velocity(joint)
            rate = self.joint_rate(joint)[1] if self._shared is None else self._shared.joint_rate(joint)[1]
            known = kernels.acceleration_step()(
                pose.rotation,
                pose.position,
                self.angular(parent)[1],
                self.linear(parent),
                motion.body(joint)[0],
                spin,
                slide,
                rate,
            )
            self._linear[joint] = known
        return known


class Velocities:
    """Velocities and bias accelerations of one :class:`Kinematics`, as expressions in its q and v.

    Args:
        rates: joint velocities in place of its v, nv numbers.
    """

    def __init__(self, kinematics: Kinematics, rates: ca.SX | None = None) -> None:
        self.kinematics = kinematics
        self.rates = kinematics.v if rates is None else rates
        self._joint: dict[int, tuple[ca.SX, ca.SX]] = {}
        self._bodies: dict[int, tuple[ca.SX, ca.SX]] = {0: (_ZERO, _ZERO)}
        #: Accelerations at zero joint acceleration, without gravity.
        self.drift = AccelerationField(self)

    def joint_velocity(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(angular, linear) velocity of the joint's child side against its parent side, child axes: S v."""
        known = self._joint.get(joint)
        if known is None:
            columns = self.kinematics.joint_columns(joint)
            step = kernels.joint_velocity(columns.stop - columns.start)
            known = step(*self.kinematics.joint_subspace(joint), self.rates[columns])
            self._joint[joint] = known
        return known

    def body(self, joint: int) -> tuple[ca.SX, ca.SX]:
        """(angular, linear at the origin) velocity of body ``joint`` in its own axes."""
        known = self._bodies.get(joint)
        if known is None:
            kin = self.kinematics
            w, v = self.body(kin.parents[joint])
            pose = kin.local_pose(joint)
            spin, slide = self.joint_velocity(joint)
            known = kernels.velocity_step()(pose.rotation, pose.position, w, v, spin, slide)
            self._bodies[joint] = known
        return known

    def frame_velocity(self, frame: str, reference: str = "world_aligned") -> ca.SX:
        """Twist (linear; angular) of a named frame [m/s; rad/s]: J v, as ``pin.getFrameVelocity``.

        Raises:
            UnknownNameError: no such frame or reference.
        """
        _check("reference", reference, REFERENCES)
        joint, placement = self.kinematics.frame(frame)
        w, v = self.body(joint)
        return self._in_reference(joint, frame, reference, v + ca.cross(w, placement.position), w)

    def bias_acceleration(self, frame: str, reference: str = "world_aligned", kind: str = "classical") -> ca.SX:
        """Acceleration (linear; angular) of a named frame at zero joint acceleration [m/s^2; rad/s^2].

        As ``pin.getFrameClassicalAcceleration`` or ``pin.getFrameAcceleration`` (``kind="spatial"``). In the
        reference ``world``, both are those of the point of the body that is at the world's origin; there the
        classical one is spatial + w x v in the coordinates of that reference.

        Raises:
            UnknownNameError: no such frame, reference or kind.
        """
        _check("reference", reference, REFERENCES)
        _check("kind", kind, KINDS)
        joint, placement = self.kinematics.frame(frame)
        alpha, omega = self.drift.angular(joint)
        point = self.drift.linear(joint) + omega @ placement.position
        if kind == "classical" and reference != "world":
            return self._in_reference(joint, frame, reference, point, alpha)
        w, v = self.body(joint)
        point = point - ca.cross(w, v + ca.cross(w, placement.position))
        out = self._in_reference(joint, frame, reference, point, alpha)
        if kind == "classical":
            twist = self.frame_velocity(frame, reference)
            out = ca.vertcat(out[:3] + ca.cross(twist[3:], twist[:3]), out[3:])
        return out

    def jacobian_drift(self, frame: str, reference: str = "world_aligned") -> ca.SX:
        """(dJ/dt) v, 6 numbers, for the Jacobian of :meth:`Kinematics.jacobian` in the same reference.

        It is the bias acceleration: the classical one for ``world_aligned``, whose origin follows the frame, the
        spatial one for ``local`` and ``world``.

        Raises:
            UnknownNameError: no such frame or reference.
        """
        kind = "classical" if reference == "world_aligned" else "spatial"
        return self.bias_acceleration(frame, reference, kind)

    def _in_reference(self, joint: int, frame: str, reference: str, linear: ca.SX, angular: ca.SX) -> ca.SX:
        """Vectors of a frame's point from the axes of body ``joint`` to a reference."""
        if reference == "local":
            turn = self.kinematics.frame(frame)[1].rotation.T
        else:
            turn = self.kinematics.joint_pose(joint).rotation
        linear, angular = turn @ linear, turn @ angular
        if reference == "world":
            linear = linear + ca.cross(self.kinematics.pose(frame).position, angular)
        return ca.densify(ca.vertcat(linear, angular))


def _check(field: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise UnknownNameError(field, value, choices)
