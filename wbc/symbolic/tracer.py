"""What a task or constraint sees of the robot, and how its expression is differentiated.

An item asks the tracer for poses, the centre of mass, joint angles; it gets *independent symbols*
for them. Its expression is then differentiated with respect to those few symbols and to q, and the
chain rule goes on with geometric Jacobians:

    de/dq v = E_q T(q) v + sum over frames f of (E_pf J_lin,f + E_Rf [J_ang,f]x R_f) v + E_c J_c v

which is exact, needs no hand-made Jacobian, and is several times smaller than automatic
differentiation through the whole kinematic chain. Rates of run-time inputs (a moving target, a
moving obstacle) go through the same expression and give its partial derivative in time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import casadi as ca

from wbc.errors import UnknownNameError
from wbc.quick_dataclasses import dataclass
from wbc.symbolic import rotations as rot
from wbc.symbolic.curvature import AppliedForce
from wbc.symbolic.kinematics import WORLD, Kinematics, Pose
from wbc.symbolic.rotations import rotation_rate

if TYPE_CHECKING:
    from wbc.symbolic.gaps import Gap
    from wbc.symbolic.motion import MotionExpressions


@dataclass(frozen=True, eq=False)
class Carrier:
    """A reference frame outside the robot as expressions of run-time values: its ``pose`` (R, p) in the world, and its
    ``twist``, 6: velocity of its origin and angular velocity, world axes.
    """

    pose: Pose
    twist: ca.SX


@dataclass
class Tracer:
    """Placeholders of one item on one robot; ask, build an expression, then differentiate it.

    With a ``carrier`` the item sees the robot from that frame: it takes the place of the world in every pose, point,
    direction and Jacobian, and ``"world"`` is its name. Placeholders stay those of the world, so that the chain rule,
    and what other items share, are the same; what the carrier's motion adds is the derivative by its pose.
    """

    kinematics: Kinematics
    carrier: Carrier | None = None
    _poses: dict[str, Pose] = field(default_factory=dict)
    _seen: dict[str, Pose] = field(default_factory=dict)
    _symbols: list[Placeholder] = field(default_factory=list)
    #: How many placeholders there were -> symbols of those that are not inner, and their values
    _outer: dict[int, tuple[ca.SX, ca.SX]] = field(default_factory=dict)
    _com: ca.SX | None = None

    @property
    def q(self) -> ca.SX:
        """Configuration symbol, nq."""
        return self.kinematics.q

    @property
    def v(self) -> ca.SX:
        """Velocity symbol, nv (the last command or the measured velocity)."""
        return self.kinematics.v

    def pose(self, frame: str) -> Pose:
        """Pose of a named frame in the world, as placeholders; ``"world"`` is the identity.

        Raises:
            UnknownNameError: no such frame.
        """
        known = self._pose(frame)
        if self.carrier is None or frame == WORLD:
            return known
        if frame not in self._seen:
            self._seen[frame] = self.carrier.pose.inverse().times(known)
        return self._seen[frame]

    def _pose(self, frame: str) -> Pose:
        """The same in the true world."""
        known = self._poses.get(frame)
        if known is not None:
            return known
        kinematics = self.kinematics
        kinematics.frame(frame)
        if frame == WORLD:
            known = kinematics.pose(frame)
        else:
            known = Pose(ca.SX.sym(f"R_{frame}", 3, 3), ca.SX.sym(f"p_{frame}", 3))
            self._symbols += of_frame(kinematics, frame, known)
        self._poses[frame] = known
        return known

    def position(self, frame: str, offset: tuple[float, float, float] | None = None) -> ca.SX:
        """Position in the world of a point fixed in a named frame [m]."""
        pose = self.pose(frame)
        return pose.position if offset is None else pose.point(ca.SX(ca.DM(list(offset))))

    def rotation(self, frame: str) -> ca.SX:
        """3x3 rotation of a named frame in the world."""
        return self.pose(frame).rotation

    def center_of_mass(self) -> ca.SX:
        """Centre of mass in the world [m], as a placeholder."""
        if self._com is None:
            self._com, kinematics = ca.SX.sym("com", 3), self.kinematics
            self._symbols.append(
                Placeholder(
                    "centre of mass",
                    self._com,
                    lambda: kinematics.center_of_mass,
                    ca.SX.eye(3),
                    lambda: kinematics.center_of_mass_jacobian,
                    places=True,
                    forces=lambda force: (AppliedForce("mass", WORLD, force),),
                    twist=lambda motion: motion.center_of_mass,
                )
            )
        return self._com if self.carrier is None else self.carrier.pose.inverse_point(self._com)

    def joint_axis(self, joint: int) -> ca.SX:
        """Axis of a one-dof joint, by number: the angular velocity that it gives, 3."""
        axis = ca.densify(self.kinematics.joint_twist(joint)[1])
        return axis if self.carrier is None else self.carrier.pose.rotation.T @ axis

    def joint_position(self, joint: int) -> ca.SX:
        """Origin of a joint's child side, by number [m]."""
        position = self.kinematics.joint_pose(joint).position
        return position if self.carrier is None else self.carrier.pose.inverse_point(position)

    def frame_jacobian(self, frame: str) -> ca.SX:
        """6 x nv Jacobian (linear at the origin; angular) of a named frame, see :meth:`point_jacobian`."""
        return self._against_carrier(self.kinematics.jacobian(frame), self._pose(frame).position)

    def point_jacobian(self, joint: int, point: ca.SX) -> ca.SX:
        """6 x nv Jacobian of the point of body ``joint`` that is at ``point`` now.

        Seen from a carrier it has one column more, the velocity that remains at v = 0. Rows of a constraint that are
        linear in such Jacobians keep that column; it goes to their sides.
        """
        place = point if self.carrier is None else self.carrier.pose.point(point)
        return self._against_carrier(self.kinematics.point_jacobian(joint, place), place)

    def _against_carrier(self, jacobian: ca.SX, place: ca.SX) -> ca.SX:
        """The Jacobian J of a point x as the carrier sees it: R_c' (J v - v_c - w_c x (x - p_c); J_w v - w_c)."""
        if self.carrier is None:
            return jacobian
        pose, twist = self.carrier.pose, self.carrier.twist
        carried = ca.vertcat(twist[:3] + ca.cross(twist[3:], place - pose.position), twist[3:])
        both = ca.horzcat(jacobian, -carried)
        return ca.vertcat(pose.rotation.T @ both[:3, :], pose.rotation.T @ both[3:, :])

    def _swung(self) -> ca.SX:
        """Zero, with the angular velocity of the carrier in its own axes as its rate, 3."""
        assert self.carrier is not None
        change = self.held(self.carrier.pose.rotation).T @ self.carrier.pose.rotation
        return 0.5 * ca.vertcat(change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1])

    def rotation_error(self, frame: str, base: str, target: ca.SX) -> ca.SX:
        """phi = log3(R_b' R R_t'): how far ``frame``, seen from ``base``, is turned past ``target`` [rad].

        A rotation vector in the axes of ``base``, |phi| <= pi. Its derivative is the closed form
        dphi = Jl^-1(phi) R_b' (w - w_b) - Jr^-1(phi) w_t with Jl^-1 of :func:`rotations.left_jacobian_inverse`
        and Jr^-1(phi) = Jl^-1(-phi), less than half of what differentiating the logarithm's branches costs.

        Args:
            target: 3x3 rotation R_t of the target in ``base``; may depend on inputs and on q.

        Raises:
            UnknownNameError: no such frame.
        """
        phi = ca.SX.sym(f"phi_{frame}_{base}", 3)
        inverse = motion = rot.left_jacobian_inverse(phi)
        # Between two frames of the robot a carrier drops out
        relative, axes = self._pose(frame).rotation, self._axes(base)
        if axes is not None:
            relative, motion = axes.T @ relative, motion @ axes.T

        value = rot.log3(relative @ target.T)
        self._symbols.append(
            Placeholder(
                f"turn {frame} {base}",
                phi,
                lambda: value,
                motion,
                partial(self._spin, frame, base),
                inner=True,
                forces=lambda torque: (AppliedForce("torque", frame, torque), AppliedForce("torque", base, -torque)),
                twist=lambda motion: motion.spin(frame, base),
            )
        )
        carried = phi if self.carrier is None or base != WORLD else phi - inverse @ self._swung()
        if not ca.symvar(target):
            return carried
        # With the target held still ``turn`` is zero and only its derivative counts
        here = self.held(target)
        change = (target - here) @ here.T
        turn = 0.5 * ca.vertcat(change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1])
        return carried - rot.left_jacobian_inverse(-phi) @ turn

    def across(self, frame: str, base: str, axes: ca.SX, turn: ca.SX) -> ca.SX:
        """Zero, with the angular velocity of ``frame`` across an axis of it as its rate: (b1, b2)' R_b' (w - w_b).

        What has curvature is the angle of the axis to a direction, for which ``turn`` stands, and not the rows: these
        turn with the axis but not about it, see :func:`wbc.symbolic.tracer.axis_curvature`.

        Args:
            axes: 3x3, unit columns b1, b2, a, fixed in ``frame``, in the axes of ``base``.
            turn: components along b1 and b2 of the shortest turn that takes the direction to a [rad].

        Raises:
            UnknownNameError: no such frame.
        """
        symbol, spin = ca.SX.sym(f"across_{frame}_{base}", 2), partial(self._spin, frame, base)
        still = self.held(axes)
        around = self._axes(base)
        outer = still if around is None else around @ still

        def forces(torque: ca.SX) -> tuple[AppliedForce, ...]:
            curved = axis_curvature(spin(), self.expand(outer[:, 2]), torque, self.expand(outer[:, :2] @ turn))
            return (
                AppliedForce("torque", frame, torque),
                AppliedForce("torque", base, -torque),
                AppliedForce("own", frame, curved),
            )

        zero = ca.SX.zeros(2)
        across = Placeholder(
            f"across {frame} {base}",
            symbol,
            lambda: zero,
            outer[:, :2].T,
            spin,
            inner=True,
            forces=forces,
            twist=lambda motion: motion.spin(frame, base),
        )
        self._symbols.append(across)
        return symbol if self.carrier is None or base != WORLD else symbol - still[:, :2].T @ self._swung()

    def _axes(self, base: str) -> ca.SX | None:
        """Axes in the true world of a frame, or of what takes the world's place; None: those of the world."""
        if base != WORLD:
            return self._pose(base).rotation
        return None if self.carrier is None else self.carrier.pose.rotation

    def _spin(self, frame: str, base: str) -> ca.SX:
        """3 x nv: angular velocity of ``frame`` past ``base`` in world axes, by v."""
        own = self.kinematics.jacobian(frame)[3:, :]
        return own if base == WORLD else own - self.kinematics.jacobian(base)[3:, :]

    def held(self, expression: ca.SX) -> ca.SX:
        """The value of an expression, which derivatives take for a constant: neither q nor inputs move it.

        With ``here = held(x)`` the term ``f(here) (x - here)`` is zero and has the rate f(x) dx/dt.
        """
        symbol, nv = ca.SX.sym("held", expression.shape[0], expression.shape[1]), self.kinematics.nv
        self._symbols.append(
            Placeholder(
                "held still",
                ca.vec(symbol),
                lambda: ca.vec(expression),
                ca.SX(expression.numel(), 0),
                lambda: ca.SX(0, nv),
                inner=True,
            )
        )
        return symbol

    def gaps(self, gaps: Sequence[Gap]) -> ca.SX:
        """Distances of bodies as a column; derivatives along v by :func:`wbc.symbolic.gaps.gap_jacobian`.

        Inputs in the distances are held: what they move is for the caller to add.
        """
        from wbc.symbolic.gaps import gap_jacobian

        count, kinematics = len(gaps), self.kinematics
        carried = ca.vertcat(ca.SX(0, 1), *[self._carried_gap(gap) for gap in gaps])
        if self.carrier is not None:
            pose = self.carrier.pose
            gaps = [replace(g, normal=pose.rotation @ g.normal, point=pose.point(g.point)) for g in gaps]
        symbol = ca.SX.sym("gap", count)
        value = ca.vertcat(ca.SX(0, 1), *[gap.distance for gap in gaps])
        motion = ca.SX(ca.DM.eye(count))
        slope = partial(gap_jacobian, kinematics, tuple(gaps))
        self._symbols.append(Placeholder("gaps", symbol, lambda: value, motion, slope, inner=True))
        return symbol + carried

    def _carried_gap(self, gap: Gap) -> ca.SX:
        """Zero, with the rate that the carrier's motion gives the distance of a link from what the carrier carries."""
        if self.carrier is None or (gap.a == WORLD) == (gap.b == WORLD):
            return ca.SX(1, 1)
        pose = self.carrier.pose
        place, normal = pose.point(self.held(gap.point)), self.held(pose.rotation @ gap.normal)
        return (-1.0 if gap.a == WORLD else 1.0) * ca.dot(normal, place - self.held(place))

    def manipulability(self, frame: str, base: str, rows: tuple[int, ...], length: float) -> ca.SX:
        """Measure of how well a frame can be moved against a base, see :mod:`wbc.symbolic.manipulability`.

        Raises:
            UnknownNameError: no such frame.
        """
        from wbc.symbolic.manipulability import manipulability, manipulability_curvature

        kinematics, symbol = self.kinematics, ca.SX.sym(f"w_{frame}_{base}")
        for name in (frame, base):
            kinematics.frame(name)
        both = cache(lambda: manipulability(kinematics, frame, base, rows, length))

        def forces(force: ca.SX) -> tuple[AppliedForce, ...]:
            return (
                AppliedForce(
                    "own", frame, force * both()[0] * manipulability_curvature(kinematics, frame, base, length)
                ),
            )

        text = f"manipulability {frame} {base} {rows} {length!r}"
        slope = Placeholder(text, symbol, lambda: both()[0], ca.SX(1), lambda: both()[1], forces=forces)
        self._symbols.append(slope)
        return symbol

    def joint(self, name: str) -> ca.SX:
        """Coordinate of a one-dof joint [rad or m]; for an unbounded joint its angle in (-pi, pi].

        Raises:
            UnknownNameError: no such one-dof joint.
        """
        model = self.kinematics.model
        single = [str(n) for j, n in enumerate(model.names) if j > 0 and int(model.nvs[j]) == 1]
        if name not in single:
            raise UnknownNameError("joint", name, single)
        coordinates = self.kinematics.joint_q(int(model.getJointId(name)))
        return coordinates if coordinates.numel() == 1 else ca.atan2(coordinates[1], coordinates[0])

    def jacobian(self, expression: ca.SX) -> ca.SX:
        """Derivative along the tangent space, rows x nv, of an expression in this tracer's symbols."""
        return self.expand(self.slope(expression))

    def slope(self, expression: ca.SX) -> ca.SX:
        """:meth:`jacobian` before the robot's kinematics are put in, to be expanded with others."""
        total = ca.jacobian(expression, self.q) @ self.kinematics.tangent_map
        for known in self._symbols:
            if not known.motion.nnz():
                continue
            change = ca.jacobian(expression, known.symbol)
            if change.nnz():
                total = total + ca.sparsify(change @ known.motion) @ known.jacobian()
        return ca.sparsify(total)

    def second(
        self,
        expression: ca.SX,
        motion: MotionExpressions,
        own: ca.SX | None = None,
        moving: Sequence[tuple[ca.SX, ca.SX]] = (),
    ) -> tuple[ca.SX, ca.SX]:
        """de/dt, and d2e/dt2 where v does not change, of an expression in this tracer's symbols at the velocity v.

        The first derivative is one of a few placeholders, their twists w_k = J_k v, and q; in it the rates of all of
        these go round once more, with dw_k/dt = (dJ_k/dt) v from the recursion that the dynamics use.

        Args:
            own: rows of de/dt along v where the expression does not have them, see ``Task.jacobian``.
            moving: (symbols, rates) of what moves besides: inputs, and rates of inputs with their accelerations.
        """
        kinematics = self.kinematics
        speed = kinematics.tangent_map @ kinematics.v
        twists: list[tuple[ca.SX, ca.SX, ca.SX]] = []
        rate = ca.SX(expression.shape[0], 1)
        used: dict[int, ca.SX] = {}

        def twist_of(known: Placeholder) -> ca.SX:
            if known.twist is None:
                # it may contain other placeholders, which go round with the rest
                return known.jacobian() @ kinematics.v
            symbol = used.get(id(known))
            if symbol is None:
                value, bias = known.twist(motion)
                symbol = used[id(known)] = ca.SX.sym(f"w_{known.name}", value.shape[0])
                twists.append((symbol, value, ca.densify(bias)))
            return symbol

        if own is None:
            rate += ca.jtimes(expression, self.q, speed)
            for known in self._symbols:
                if known.motion.nnz():
                    change = ca.jacobian(expression, known.symbol)
                    if change.nnz():
                        rate += ca.sparsify(change @ known.motion) @ twist_of(known)
        else:
            rate += along(own, kinematics.v)
        for symbols, rates in moving:
            rate += ca.jtimes(expression, symbols, rates)
        rate = self._without_inner([ca.densify(rate)])[0]
        variables, changes = [self.q], [speed]
        for known in self._symbols:
            if not known.inner and known.motion.nnz() and ca.jacobian_sparsity(rate, known.symbol).nnz():
                variables.append(known.symbol)
                changes.append(known.motion @ twist_of(known))
        for symbol, _, bias in list(twists):
            variables.append(symbol)
            changes.append(bias)
        for symbols, rates in moving:
            variables.append(symbols)
            changes.append(rates)
        bias = ca.jtimes(rate, ca.vertcat(*variables), ca.densify(ca.vertcat(*changes)))
        both = ca.vertcat(rate, bias)
        if twists:
            both = ca.substitute(both, ca.vertcat(*[t[0] for t in twists]), ca.vertcat(*[t[1] for t in twists]))
        both = ca.densify(self.expand(both))
        count = expression.shape[0]
        return both[:count], both[count:]

    def forces(self, expression: ca.SX) -> list[AppliedForce]:
        """Forces and torques on the robot whose virtual work is the derivative of a scalar expression.

        What depends on joint coordinates directly has no curvature and gives none.
        """
        out: list[AppliedForce] = []
        works: list[tuple[Placeholder, ca.SX]] = []
        for known in self._symbols:
            partial = ca.jacobian(expression, known.symbol)
            if partial.nnz() and known.motion.nnz():
                work = ca.densify(partial @ known.motion).T
                out += known.forces(self.expand(work))
                works.append((known, work))
        curved = turning(works, self._symbols, self.expand, self.kinematics.nv)
        return [*out, AppliedForce("own", WORLD, curved)] if curved.nnz() else out

    def expand(self, expression: ca.SX) -> ca.SX:
        """The expression with every placeholder replaced by the kinematics that it stands for."""
        return self.expanded(expression)[0]

    def expanded(self, *expressions: ca.SX) -> list[ca.SX]:
        """Each of them expanded; at once, so that they still share what they share."""
        out = self._without_inner(expressions)
        if all(s.inner for s in self._symbols):
            return out
        known = self._outer.get(len(self._symbols))
        if known is None:
            outer = [s for s in self._symbols if not s.inner]
            # A chain of coordinate axes has structural zeros that its placeholders have not
            values = ca.densify(ca.vertcat(*[s.value() for s in outer]))
            known = self._outer[len(self._symbols)] = ca.vertcat(*[s.symbol for s in outer]), values
        return list(ca.substitute(out, known[:1], known[1:]))

    def formula(self, expression: ca.SX) -> tuple[ca.SX, dict[str, ca.SX]]:
        """The expression before the robot's kinematics are put in, and its symbols by what they stand for.

        It has as many operations as the user wrote, so it is cheap to compare and to hash.
        """
        symbols = {"q": self.q} | {s.name: s.symbol for s in self._symbols if not s.inner}
        return self._without_inner([expression])[0], symbols

    def _without_inner(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        inner = [s for s in self._symbols if s.inner]
        if not inner:
            return list(expressions)
        symbols, values = [s.symbol for s in inner], [ca.densify(s.value()) for s in inner]
        return list(ca.substitute_inplace(symbols, values, list(expressions))[1])


@dataclass
class Placeholder:
    """A ``symbol`` and the ``value`` it stands for; its rate is ``motion @ jacobian @ v``.

    The rate is kept as two factors because ``(partial @ motion) @ jacobian`` is much smaller than
    ``partial @ (motion @ jacobian)``. Kinematics are built when they are needed, so that an item can be traced
    (to count its rows, to make its cache key) without them. ``inner``: value and motion are in other placeholders.
    ``places``: it is where a frame or the centre of mass is, with which forces change. ``twist``:
    ``jacobian @ v``, and its rate where v does not change, from a recursion over the bodies; None: from the Jacobian.
    ``forces``: what a force along the rate, given as a 3-vector in the axes of ``jacobian``, does to the robot.
    """

    name: str
    symbol: ca.SX
    value: Callable[[], ca.SX]
    motion: ca.SX
    jacobian: Callable[[], ca.SX]
    inner: bool = False
    places: bool = False
    forces: Callable[[ca.SX], tuple[AppliedForce, ...]] = lambda force: ()
    twist: Callable[[MotionExpressions], tuple[ca.SX, ca.SX]] | None = None


def along(matrix: ca.SX, v: ca.SX) -> ca.SX:
    """Rows by v, with the column of what remains at v = 0, see :meth:`Tracer.point_jacobian`."""
    return matrix[:, : v.numel()] @ v + ca.sum2(matrix[:, v.numel() :])


def of_frame(kinematics: Kinematics, frame: str, pose: Pose) -> list[Placeholder]:
    """The two that stand for a named frame: its position, moved by the linear rows of its Jacobian, and its rotation,
    moved by the angular rows. ``pose``: their symbols.
    """
    position = Placeholder(
        f"position {frame}",
        pose.position,
        lambda: kinematics.pose(frame).position,
        ca.SX.eye(3),
        lambda: kinematics.jacobian(frame)[:3, :],
        places=True,
        forces=lambda force: (AppliedForce("force", frame, force),),
        twist=lambda motion: motion.part(frame, slice(0, 3)),
    )
    rotation = Placeholder(
        f"rotation {frame}",
        ca.vec(pose.rotation),
        lambda: ca.vec(kinematics.pose(frame).rotation),
        rotation_rate(pose.rotation),
        lambda: kinematics.jacobian(frame)[3:, :],
        places=True,
        forces=lambda torque: (AppliedForce("torque", frame, torque),),
        twist=lambda motion: motion.part(frame, slice(3, 6)),
    )
    return [position, rotation]


def turning(
    works: Sequence[tuple[Placeholder, ca.SX]],
    placeholders: Sequence[Placeholder],
    expand: Callable[[ca.SX], ca.SX],
    nv: int,
) -> ca.SX:
    """What forces and torques add to the curvature because they change with where frames are, nv x nv:

        symmetric part of  sum over k, l of  J_k' (dw_k/ds_l) J_l        w_k: force along the rate of placeholder k

    Pairs without a place are left out: those are errors with curvature of their own.

    Args:
        works: placeholders that an expression depends on, each with its force. expand: puts the kinematics in.
    """
    total = ca.SX(nv, nv)
    for cause in placeholders:
        felt = ca.SX(nv, 3)
        for force, work in works:
            if not (force.places or cause.places) or not cause.motion.nnz():
                continue
            change = ca.sparsify(ca.jacobian(work, cause.symbol) @ cause.motion)
            if change.nnz():
                felt += ca.sparsify(force.jacobian().T @ expand(change))
        if felt.nnz():
            part = felt @ cause.jacobian()
            total += 0.5 * (part + part.T)
    return ca.sparsify(total)


def axis_curvature(spin: ca.SX, axis: ca.SX, torque: ca.SX, turn: ca.SX) -> ca.SX:
    """What a torque m across an axis a adds to the curvature where the axis alone counts, nv x nv.

        J' (- (a t' + t a') / 2  +  m.n (cot theta - 1/theta) (a x n)(a x n)') J,        t = a x m

    The first part undoes what a turn about the axis would curve: with it, its row of the curvature is zero. The second
    is that of the angle to a direction, which the turn theta n takes to a; of its bracket no less than -3 counts, and
    below 1e-4 rad it is left out. Then J'J and the curvature for m = theta n are the second derivative of theta^2 / 2.

    Args:
        spin: J, 3 x nv, angular velocity of the axis. axis, torque, turn: a, m, theta n in its axes.
    """
    theta = ca.norm_2(turn)
    inside = theta > 1e-4
    safe = ca.if_else(inside, theta, 1.0)
    share = ca.fmax(ca.cos(safe) / ca.sin(safe) - 1.0 / safe, -3.0) / safe**3
    along, aside, sideways = spin.T @ axis, spin.T @ ca.cross(axis, torque), spin.T @ ca.cross(axis, turn)
    curved = -0.5 * (along @ aside.T + aside @ along.T)
    return curved + ca.if_else(inside, ca.dot(torque, turn) * share, 0.0) * sideways @ sideways.T
