"""The robot: a model with limits, named frames, link shapes and couplings. Immutable."""

from __future__ import annotations

import hashlib
import itertools
import logging
from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cached_property
from math import hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import pickling, validation
from wbc.errors import (
    BoundsError,
    DuplicateNameError,
    RangeError,
    RobotFileError,
    RotationError,
    ShapeError,
    UnsupportedJointError,
)
from wbc.multibody import CONVERTED, algebra, in_pinocchio, own, pin, to_pin
from wbc.quick_dataclasses import dataclass
from wbc.robot.limits import Limits
from wbc.robot.loops import AnyLoop, Closing, JointCurve, Loop, LoopError, LoopRows
from wbc.robot.motor_space import MotorSpace
from wbc.robot.shortest_steps import CLOSED
from wbc.shapes import PlacedShape
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot.dead_points import DeadPoint, DeadPointSearch

_ARRAY = np.ndarray
_FLOAT = np.dtype(np.float64)

log = logging.getLogger("wbc")

#: How MuJoCo writes an upright base: as x, y, z, w half a turn about x
MUJOCO_UPRIGHT = (1.0, 0.0, 0.0, 0.0)

BASES = ("fixed", "floating", "planar", "differential")
#: Configurations no joint of which is further apart are one [rad, m]
SAME = 1e-6
#: Random configurations from which loops are closed before they are said to be open for ever
DRAWS = 100
#: Configurations about neutral at which rows that others imply are found
LOOKS = 8
#: How far joints are from neutral there [rad, m]
NEAR = 0.5
#: From where on a linkage is near its dead point [rad, or characteristic lengths]
NEAR_DEAD_POINT = 0.1


@dataclass(frozen=True)
class Coupling:
    """A mimic joint: v[follower] = ratio * v[leader], and q likewise plus ``offset``. Indices into v."""

    follower: int
    leader: int
    ratio: float
    offset: float = 0.0

    def of_leader(self, low: float, high: float) -> tuple[float, float]:
        """Between which values of the leader the follower is from ``low`` to ``high``: q_l = (q_f - offset) / ratio."""
        first, last = sorted(((low - self.offset) / self.ratio, (high - self.offset) / self.ratio))
        return first, last


@in_pinocchio("model")
@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A robot model and what the description says about it.

    Attributes:
        name: short name, as ``wbc.robots.load`` takes it.
        model: the model as Pinocchio's, which is imported when this is first read; where it is not installed, the
            package's own. Not to be changed; added frames are in it.
        limits: see :class:`Limits`.
        base: ``fixed``, ``floating`` (free flyer), ``planar`` (x, y, yaw) or ``differential`` (planar,
            no sideways velocity).
        neutral: a configuration within the position limits, used where one is needed [nq].
        shapes: link frame name -> collision shapes fixed to it.
        couplings: mimic joints that are kept as degrees of freedom.
        frames: role -> frame name ("tip", "shoulder", "elbow", "wrist", ...), where the table knows them.
        notes: where limits come from, one sentence a key ("acceleration", "shapes", ...).
        locked_dofs: degrees of freedom that the robot cannot drive, whose velocity must stay 0 (the sideways
            velocity of a differential-drive base, a URDF's floating joint that is no base). Indices into v.
        passive: degrees of freedom that move and that no motor drives, those of a base aside, see
            :meth:`with_actuated`. Indices into v.
        source: the file that the model was read from; "" for a model made in memory.
        self_pairs: pairs of links with shapes that must not touch each other; None: not chosen yet.
        loops: closed loops of the mechanism, see :meth:`with_loops`; ``neutral`` is a configuration that closes them.
    """

    name: str
    model: pin.Model
    limits: Limits
    base: str = "fixed"
    neutral: Array = field(default_factory=lambda: np.zeros(0))
    shapes: Mapping[str, tuple[PlacedShape, ...]] = field(default_factory=dict)
    couplings: tuple[Coupling, ...] = ()
    frames: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    locked_dofs: tuple[int, ...] = ()
    passive: tuple[int, ...] = ()
    source: str = ""
    self_pairs: tuple[tuple[str, str], ...] | None = None
    loops: LoopRows = field(default_factory=LoopRows)

    def __post_init__(self) -> None:
        validation.one_of("robot.base", self.base, BASES)
        if self.limits.velocity.shape != (self.nv,):
            raise ShapeError("robot.limits", self.limits.velocity, f"expected {self.nv} entries each")
        self._check_position_limits()
        for name in ("locked_dofs", "passive"):
            for dof in getattr(self, name):
                if not 0 <= dof < self.nv:
                    raise RangeError(f"robot.{name}", dof, f"expected an index into v, 0 to {self.nv - 1}")
        neutral = self.neutral if np.size(self.neutral) else algebra(self.tree).neutral(self.tree)
        object.__setattr__(self, "neutral", self.configuration("robot.neutral", neutral))
        self.neutral.flags.writeable = False

    def __repr__(self) -> str:
        return f"<Robot {self.name!r}: {len(self.joint_names)} joints, nq {self.nq}, nv {self.nv}, {self.base} base>"

    def __getstate__(self) -> dict[str, Any]:
        return pickling.declared(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        pickling.restore(self, state, {f.name for f in fields(self)})
        pickling.freeze(self)

    @property
    def tree(self) -> Any:
        """The model as it was read or given: this package's own of a robot that was read, by which it is declared and
        solved; not to be changed.
        """
        return vars(self)["model"]

    def copied_tree(self) -> tuple[Any, Any]:
        """(a model of its own with the same contents, the library whose model it is)."""
        library = algebra(self.tree)
        return library.Model(self.tree), library

    @property
    def nq(self) -> int:
        """Numbers in a configuration."""
        return int(self.tree.nq)

    @property
    def nv(self) -> int:
        """Degrees of freedom (numbers in a velocity)."""
        return int(self.tree.nv)

    @property
    def base_nv(self) -> int:
        """Degrees of freedom of the base, which come first in v: 0, 3 or 6."""
        return {"fixed": 0, "floating": 6}.get(self.base, 3)

    @cached_property
    def unactuated(self) -> tuple[int, ...]:
        """Degrees of freedom without a motor, a floating base's and :attr:`passive`, whose torque is 0; places in v."""
        return (*range(6 if self.base == "floating" else 0), *self.passive)

    @cached_property
    def motors(self) -> tuple[int, ...]:
        """Degrees of freedom that motors drive, followers of couplings left out: ``step.torque[list(robot.motors)]``.
        Indices into v.
        """
        others = {*self.unactuated, *self.locked_dofs, *(coupling.follower for coupling in self.couplings)}
        return tuple(dof for dof in range(self.nv) if dof not in others)

    @cached_property
    def motor_names(self) -> tuple[str, ...]:
        """Names of the :attr:`motors`' degrees of freedom."""
        return tuple(self.dof_names[dof] for dof in self.motors)

    @cached_property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames, ``"world"`` first."""
        seen = dict.fromkeys([WORLD] + [str(f.name) for f in self.tree.frames])
        return tuple(seen)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints, the base joint included."""
        return tuple(str(n) for n in list(self.tree.names)[1:])

    @cached_property
    def dof_names(self) -> tuple[str, ...]:
        """One label a degree of freedom: the joint's name, with a suffix where a joint has several."""
        suffixes = {6: ("x", "y", "z", "rx", "ry", "rz"), 3: ("x", "y", "yaw")}
        out: list[str] = []
        for j in range(1, self.tree.njoints):
            name, nv = str(self.tree.names[j]), int(self.tree.nvs[j])
            if nv == 1:
                out.append(name)
                continue
            labels = suffixes.get(nv, tuple(str(i) for i in range(nv)))
            if "Spherical" in self.tree.joints[j].shortname():
                labels = ("rx", "ry", "rz")
            out += [f"{name}.{label}" for label in labels]
        return tuple(out)

    @cached_property
    def dof_units(self) -> tuple[str, ...]:
        """``"rad"`` or ``"m"`` for each degree of freedom."""
        # A column's angular part is as long in every frame
        jacobian = algebra(self.tree).computeJointJacobians(self.tree, self.tree.createData(), self.neutral)
        turning = np.linalg.norm(jacobian[3:], axis=0)
        return tuple("rad" if length > 1e-9 else "m" for length in turning)

    @cached_property
    def position_index(self) -> Array:
        """Per degree of freedom, the index in q of the coordinate that it is the rate of, or -1."""
        out = np.full(self.nv, -1, dtype=int)
        for j in range(1, self.tree.njoints):
            nq, nv = int(self.tree.nqs[j]), int(self.tree.nvs[j])
            if nq == nv:
                for k in range(nv):
                    out[int(self.tree.idx_vs[j]) + k] = int(self.tree.idx_qs[j]) + k
        return out

    @cached_property
    def characteristic_length(self) -> float:
        """The length [m] that ties metres to radians: the longest chain of joint placements from the root.

        A metre of error costs as much as 1 / length radians. It scales with the robot, so a model in
        millimetres gets the same answers. 1 for a robot whose joints all share one origin.
        """
        reach = np.zeros(self.tree.njoints)
        for j in range(1, self.tree.njoints):
            parent = int(self.tree.parents[j])
            step = float(np.linalg.norm(self.tree.jointPlacements[j].translation)) if parent > 0 else 0.0
            reach[j] = reach[parent] + step
        longest = float(reach.max()) if len(reach) else 0.0
        return longest if longest > 0.0 else 1.0

    def check_frame(self, field_name: str, frame: Any) -> str:
        """The frame's name, or an :class:`UnknownNameError` that lists the nearest ones."""
        return validation.one_of(field_name, frame, self.frame_names)

    def dofs(self, joint: str, field_name: str = "joint") -> slice:
        """Where the velocities of a joint stand in v.

        Raises:
            UnknownNameError: no such joint.
        """
        validation.one_of(field_name, joint, self.joint_names)
        j = int(self.tree.getJointId(joint))
        start = int(self.tree.idx_vs[j])
        return slice(start, start + int(self.tree.nvs[j]))

    def configuration(self, field_name: str, q: Any) -> Array:
        """A checked float64 copy of a configuration; quaternions and unit circles must have unit length.

        Raises:
            ShapeError, NotFiniteError, RotationError: it is none.
        """
        out = validation.real_array(field_name, q, (self.nq,))
        if not self._is_normalized(out):
            raise RotationError(field_name, q, "a quaternion or (cos, sin) pair is not of unit length")
        if self.base == "floating" and np.array_equal(out[3:7], MUJOCO_UPRIGHT):
            log.warning("%s: the base is upside down; quaternions are x, y, z, w, MuJoCo's w, x, y, z", field_name)
        return out

    def _is_normalized(self, q: Array) -> bool:
        if not isinstance(self.tree, own.Model):
            return bool(pin.isNormalized(self.tree, q, validation.ROTATION_TOLERANCE))
        return all(
            joint.unit_error(q[joint.idx_q : joint.idx_q + joint.nq]) <= validation.ROTATION_TOLERANCE
            for joint in self._turning
        )

    @cached_property
    def _turning(self) -> tuple[own.JointModel, ...]:
        """Joints with numbers that must be of unit length."""
        return tuple(joint for joint in self.tree.joints if joint.nq != joint.nv)

    def pose(self, q: Any, frame: str, relative_to: str = WORLD) -> pin.SE3:
        """Pose of a frame in another one, or in the world, at a configuration.

        Raises:
            UnknownNameError: no such frame. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        q, names = self.configuration("q", q), (WORLD, *self.frame_names)
        data = self.model.createData()
        pin.forwardKinematics(self.model, data, q)
        of, base = (
            pin.SE3.Identity()
            if name == WORLD
            else pin.updateFramePlacement(self.model, data, frame_index(self.model, name)).copy()
            for name in (validation.one_of("frame", frame, names), validation.one_of("relative_to", relative_to, names))
        )
        return base.actInv(of)

    def jacobian(self, q: Any, frame: str) -> Array:
        """J with (linear; angular) = J v: the twist of a frame at its origin, along the world's axes [6, nv].

        Raises:
            UnknownNameError: no such frame. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        q, named = self.configuration("q", q), self.check_frame("frame", frame)
        if named == WORLD:
            return np.zeros((6, self.nv))
        index = frame_index(self.model, named)
        axes, data = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, self.model.createData()
        return np.asarray(pin.computeFrameJacobian(self.model, data, q, index, axes))

    def motor_jacobian(self, q: Any) -> Array:
        """G with v = G (v_base; v_motors): how all joints move with a floating base and the motors where loops and
        couplings hold, J_l v = 0 [nv, (6 +) motors]. With B a basis of the motions that these allow, and B_m its rows
        of the base and the motors,

            G = B B_m^+,     v_frame = robot.jacobian(q, frame) @ G @ v_motors,     tau_motors = G' tau

        where B_m^+ is the pseudoinverse: what motors never move, such as a rod that turns about itself, is at rest.

        Raises:
            LoopError: a dead point: the motors do not say how a joint moves that they move elsewhere.
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        jacobian, lost = self._motor_space.jacobian(self.configuration("q", q))
        if lost >= 0:
            raise LoopError("q", q, f"a dead point: the motors do not say how {self.dof_names[lost]} moves")
        return jacobian

    def at_motors(self, q: Any, tau: Any) -> Array:
        """Torques of the motors that do what generalised forces would, G' tau, and 0 elsewhere [nv]; of a robot without
        loops and passive joints ``tau`` itself.

        Raises:
            As of :meth:`motor_jacobian`.
        """
        forces = validation.real_array("tau", tau, (self.nv,))
        if not (self.loops or self.passive):
            return forces
        out = np.zeros(self.nv)
        out[self._said] = self.motor_jacobian(q).T @ forces
        out[list(self.unactuated)] = 0.0
        return out

    @cached_property
    def _said(self) -> list[int]:
        """Degrees of freedom of a floating base and of motors."""
        return [*range(6 if self.base == "floating" else 0), *self.motors]

    @cached_property
    def _motor_space(self) -> MotorSpace:
        return MotorSpace(self._tied, self._said, [self.neutral, *self._near(np.random.default_rng(0))])

    def _tied(self, q: Array) -> Array:
        """Rows of couplings, undriven directions and loops [rows, nv]."""
        rows = np.zeros((len(self.couplings) + len(self.locked_dofs), self.nv))
        for row, one in zip(rows, self.couplings, strict=False):
            row[[one.follower, one.leader]] = 1.0, -one.ratio
        rows[range(len(self.couplings), len(rows)), list(self.locked_dofs)] = 1.0
        return np.concatenate([rows, self._closing.look(q)[1]]) if self.loops else rows

    def dead_points(self, q: Any, within: float = NEAR_DEAD_POINT) -> tuple[DeadPoint, ...]:
        """Linkages near a configuration where their motors do not say how all of them moves, or their loops leave two
        ways: with the least singular value sigma of the loops' rows, those of :attr:`passive` joints or all,

            distance = sigma / |d sigma / dq|       along motions that the loops allow

        Args:
            within: of which distance they are named [rad, or characteristic lengths].

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration. RangeError: a distance below 0.
        """
        most = validation.scalar("within", within, low=0.0)
        checked = self.configuration("q", q)
        return self._dead_points.near(checked, most) if self.loops else ()

    @cached_property
    def _dead_points(self) -> DeadPointSearch:
        from wbc.robot.dead_points import DeadPointSearch

        units = np.where(np.array(self.dof_units) == "m", self.characteristic_length, 1.0)
        sizes = np.array([self.characteristic_length if unit == "m" else 1.0 for _, unit in self.loops.rows])

        def rows(q: Array) -> Array:
            whole, parts = self._closing.look(q)[1], zip(self.loops.bases, self._closing.spans, strict=False)
            return np.asarray(np.concatenate([basis @ whole[span] for basis, span in parts]) * units / sizes[:, None])

        def moved(q: Array, way: Array) -> Array:
            return np.asarray(pin.integrate(self.model, q, way * units))

        looks = [self.neutral, *self._near(np.random.default_rng(0))]
        return DeadPointSearch(rows, moved, self.loops.linkages, self.passive, self.dof_names, looks)

    def _near(self, rng: np.random.Generator) -> list[Array]:
        """Closed configurations about neutral."""
        near = (pin.integrate(self.model, self.neutral, rng.uniform(-NEAR, NEAR, self.nv)) for _ in range(DRAWS))
        found = (q for q, opened in map(self._closing.close, near) if opened <= CLOSED)
        return list(itertools.islice(found, LOOKS))

    def integrate(self, q: Any, v: Any, dt: float = 1.0) -> Array:
        """q (+) v dt: the configuration after moving with a velocity for a time [s]; of a mechanism with loops the
        nearest that closes them, or leaves them open least.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration, velocity or time.
        """
        plain = type(q) is _ARRAY is type(v) and q.dtype is _FLOAT is v.dtype and type(dt) is float
        plain = plain and q.shape == v.shape == self._straight
        if plain and hypot(*q.tolist()) < validation.LARGEST > hypot(*v.tolist()) and abs(dt) < validation.LARGEST:
            # Asked for in every tick of a loop; the other way takes three times as long, to the same bits
            return np.asarray(q + v * dt)
        step = validation.real_array("v", v, (self.nv,)) * validation.real_array("dt", dt, ())
        later = np.asarray(pin.normalize(self.model, pin.integrate(self.model, self.configuration("q", q), step)))
        return self._closing.close(later)[0] if self.loops else later

    @cached_property
    def _straight(self) -> tuple[int, ...] | None:
        """Shape of configurations where q (+) v dt is their sum; None where it is not."""
        joints = [(int(joint.nq), int(joint.nv)) for joint in list(self.tree.joints)[1:]]
        return (self.nq,) if not self.loops and set(joints) <= {(1, 1)} else None

    def difference(self, a: Any, b: Any) -> Array:
        """b (-) a: the velocity that leads from one configuration to another within a second [nv].

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        return np.asarray(pin.difference(self.model, self.configuration("a", a), self.configuration("b", b)))

    def random(self, seed: int | np.random.Generator = 0) -> Array:
        """A configuration within the position limits; what has none is within half a turn, or a metre, of neutral.

        Joints that follow others are where those put them, within their own limits; loops are closed.

        Args:
            seed: a whole number, which gives the same configuration each time, or the generator that draws.

        Raises:
            RangeError: a seed below 0. LoopError: a hundred draws led to no configuration that closes the loops.
        """
        if isinstance(seed, np.random.Generator):
            rng = seed
        else:
            rng = np.random.default_rng(int(validation.scalar("seed", seed, low=0.0)))
        return self._closing.first(self._drawn(rng) for _ in range(DRAWS)) if self.loops else self._drawn(rng)

    def _drawn(self, rng: np.random.Generator) -> Array:
        reach = np.where(np.array([unit == "rad" for unit in self.dof_units]), np.pi, 1.0)
        out = np.asarray(pin.normalize(self.model, pin.integrate(self.model, self.neutral, rng.uniform(-reach, reach))))
        limits, index = self.coupled(self.limits), self.position_index
        lower, upper = limits.position_lower, limits.position_upper
        for k in np.flatnonzero(index >= 0).tolist():
            low, high = float(lower[k]), float(upper[k])
            if np.isfinite([low, high]).all():
                out[int(index[k])] = rng.uniform(low, high)
        for one in self.couplings:
            out[int(index[one.follower])] = one.ratio * out[int(index[one.leader])] + one.offset
        return out

    def coupled(self, limits: Limits) -> Limits:
        """The same limits with those of followers taken over by their leaders, and theirs by followers:

            q_f = ratio q_l + offset,   v_f = ratio v_l,   a_f = ratio a_l

        so that one interval of the leader, times the ratio, is that of each follower. Efforts stay as they are.

        Raises:
            ShapeError: no Limits, or of another number of degrees of freedom.
            BoundsError: a follower whose range no value of its leader leads into.
        """
        limits = validation.instance("limits", limits, Limits, "wbc.robot.Limits")
        validation.real_array("limits.velocity", limits.velocity, (self.nv,), finite=False)
        if not self.couplings:
            return limits
        low, high = limits.position_lower.copy(), limits.position_upper.copy()
        rates = [limits.velocity.copy(), limits.acceleration.copy()]
        index, moved = self.position_index, [one for one in self.couplings if one.ratio != 0.0]
        # as often as there are couplings: a follower may lead another
        for one in (one for one in self.couplings if one.ratio == 0.0):
            if not low[one.follower] - SAME <= one.offset <= high[one.follower] + SAME:
                own = [float(low[one.follower]), float(high[one.follower])]
                reason = f"no value is left: it stands at {one.offset:.6g}, whatever {self.dof_names[one.leader]} does"
                raise BoundsError(f"limits of {self.dof_names[one.follower]}", own, reason)
        for one in moved * len(moved):
            if index[one.leader] >= 0:
                low[one.leader], high[one.leader] = self._left(one, low, high)
            for most in rates:
                most[one.leader] = min(most[one.leader], most[one.follower] / abs(one.ratio))
        for one in moved * len(moved):
            if index[one.leader] >= 0:
                ends = sorted(one.ratio * bound[one.leader] + one.offset for bound in (low, high))
                low[one.follower], high[one.follower] = ends
            for most in rates:
                most[one.follower] = most[one.leader] * abs(one.ratio)
        return limits.override(position_lower=low, position_upper=high, velocity=rates[0], acceleration=rates[1])

    def _left(self, one: Coupling, low: Array, high: Array) -> tuple[float, float]:
        """What is left of a leader's range where its follower keeps to its own."""
        own, ends = (low[one.leader], high[one.leader]), one.of_leader(low[one.follower], high[one.follower])
        least, most = max(own[0], ends[0]), min(own[1], ends[1])
        if least > most + SAME:
            leader, follower = self.dof_names[one.leader], self.dof_names[one.follower]
            reason = f"no value is left: {follower} follows it, and is within its own limits from {ends[0]:.6g} to "
            raise BoundsError(f"limits of {leader}", [float(end) for end in own], f"{reason}{ends[1]:.6g} of {leader}")
        return min(least, most), max(least, most)

    def with_frame(self, name: str, parent: str, placement: Any = None) -> Robot:
        """A copy with one more frame, fixed to ``parent`` at ``placement`` (default: identity).

        Raises:
            DuplicateNameError, UnknownNameError: of the frames. ShapeError, NotFiniteError, RotationError: no pose.
        """
        validation.name("frame", name)
        if name in self.frame_names:
            raise DuplicateNameError("frame", name, "a frame of this name exists")
        self.check_frame("parent", parent)
        local = validation.own_pose("placement", placement) if placement is not None else None
        model, library = self.copied_tree()
        local = library.SE3.Identity() if local is None else library.SE3(local.rotation, local.translation)
        if parent == WORLD:
            model.addFrame(library.Frame(name, 0, 0, local, library.FrameType.OP_FRAME))
        else:
            index = frame_index(model, parent)
            above = model.frames[index]
            kind = library.FrameType.OP_FRAME
            model.addFrame(library.Frame(name, above.parentJoint, index, above.placement * local, kind))
        return changed(self, model=model)

    def with_actuated(self, joints: Sequence[str]) -> Robot:
        """A copy of which motors drive these joints, and no others: the others move with what carries them, by loops or
        by themselves, and their torque is 0. A coupling is driven by any of its joints.

        Raises:
            UnknownNameError: no such joint. ShapeError: no names. RangeError: a floating base.
        """
        driven: set[int] = set()
        for name in validation.strings("actuated", joints):
            dofs = self.dofs(name, "actuated")
            if self.base == "floating" and dofs.start == 0:
                raise RangeError("actuated", name, "no motor drives a floating base")
            driven |= set(range(dofs.start, dofs.stop))
        driven |= {one.leader for one in self.couplings if one.follower in driven}
        driven |= {*range(self.base_nv), *self.locked_dofs, *(one.follower for one in self.couplings)}
        return changed(self, passive=tuple(dof for dof in range(self.nv) if dof not in driven))

    def with_loops(self, *loops: AnyLoop, actuated: Sequence[str] | None = None) -> Robot:
        """A copy whose mechanism has these closed loops, in place of those it had; none: an open tree.

            robot.with_frame("pin", "coupler", offset).with_loops(Loop("four-bar", "pin", "rocker_end"))

        ``neutral`` becomes the nearest configuration that closes them. Rows that others imply are left out: those out
        of the plane of a planar mechanism, and loops that add nothing. Every stack keeps them closed. Joints that
        nothing drives, whose velocity had to stay 0, are passive where loops move them.

        Args:
            loops: see above. actuated: joints with motors, as of :meth:`with_actuated`; None: as before.

        Raises:
            UnknownNameError: no such frame or joint. DuplicateNameError: two loops of one name.
            LoopError: no configuration closes them all; by how much the nearest that was found does not.
        """
        for loop in loops:
            validation.instance("loops", loop, (Loop, JointCurve), "a Loop or a JointCurve")
            if isinstance(loop, Loop):
                self.check_frame(f"{loop.name}.first", loop.first)
                self.check_frame(f"{loop.name}.second", loop.second)
        names = [loop.name for loop in loops]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise DuplicateNameError("loops", twice, "two loops have this name")
        bare = changed(self if actuated is None else self.with_actuated(actuated), loops=LoopRows())
        if not loops:
            return bare
        closing, rng = replace(bare, loops=LoopRows(loops))._closing, np.random.default_rng(0)
        neutral = closing.first(itertools.chain([self.neutral], (bare._drawn(rng) for _ in range(DRAWS))))
        looks = [neutral, *replace(bare, neutral=neutral, loops=LoopRows(loops))._near(rng)]
        units = {name: self.dof_units[self.dofs(name).start] for name in self.joint_names}
        rows = closing.rows(len(loops), looks, units)
        for loop, basis in zip(loops, rows.bases, strict=True):
            if not len(basis):
                log.warning("%s: the loop %r adds nothing to the others", self.name, loop.name)
        for part in rows.linkages:
            if part.held == len(part.dofs):
                said = "its loops hold as many motions as it has joints; lengths of the file may be rounded"
                log.warning("%s: the linkage of %s cannot move: %s", self.name, part.name, said)
        moved = {dof for part in rows.linkages for dof in part.dofs if dof in self.locked_dofs and dof >= self.base_nv}
        still = tuple(dof for dof in self.locked_dofs if dof not in moved)
        return replace(
            bare,
            neutral=neutral,
            loops=rows,
            notes={key: said for key, said in bare.notes.items() if key != "undriven" or still},
            locked_dofs=still,
            passive=tuple(sorted({*bare.passive, *moved})),
        )

    def require_tree(self, what: str) -> None:
        """Refuse a mechanism with closed loops.

        Args:
            what: needs a tree, in the words of the text: "a plant of rigid bodies".

        Raises:
            UnsupportedJointError: it has loops; which, and that :meth:`with_loops` without any opens them.
        """
        if self.loops:
            reason = f"{what} knows no closed loops; robot.with_loops() opens them"
            raise UnsupportedJointError("robot", self.loops.names, reason)

    def closed(self, q: Any) -> Array:
        """The nearest configuration that closes the loops, by Newton's shortest steps from q.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration. LoopError: they led to none.
        """
        start = self.configuration("q", q)
        if not self.loops:
            return start
        return self._closing.first([start])

    def loop_gaps(self, q: Any) -> dict[str, float]:
        """The largest residual of each closed loop at a configuration, by its name [m, rad]; what no joint moves, up to
        1e-6, does not count: numbers of a file are rounded.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        checked = self.configuration("q", q)
        return self._closing.gaps(checked) if self.loops else {}

    def assemblies(self, joints: Any, count: int = 100, seed: int = 0) -> tuple[Array, ...]:
        """Configurations that close the loops with some joints where they are given: the assembly modes that searches
        from random starts lead to, the nearest to neutral first; of a mechanism that these joints leave free, some.
        Whole turns make no other mode.

        Args:
            joints: name -> value [rad or m], of joints with one coordinate. count: of searches. seed: of their starts.

        Raises:
            UnknownNameError: no such joint. RangeError: a count below 1.
        """
        still = []
        for name, value in validation.mapping("joints", joints, "joints to values").items():
            validation.one_of("joints", name, self.joint_names)
            still.append(JointCurve(f"given {name}", name, None, (validation.scalar(f"joints[{name!r}]", value),)))
        searches = validation.integer("count", count, low=1)
        given, rng = changed(self, loops=LoopRows((*self.loops.loops, *still)))._closing, np.random.default_rng(seed)
        found, turn = list[Array](), np.where(np.array(self.dof_units) == "rad", 2.0 * np.pi, np.inf)
        for start in itertools.chain([self.neutral], (self._drawn(rng) for _ in range(searches - 1))):
            q, opened = given.close(start)
            apart = [np.abs(self.difference(q, one)) for one in found]
            if opened <= CLOSED and all(np.minimum(far % turn, -far % turn).max() > SAME for far in apart):
                found.append(q)
        return tuple(sorted(found, key=lambda q: float(np.abs(self.difference(self.neutral, q)).max())))

    @cached_property
    def _closing(self) -> Closing:
        joints = {int(self.tree.idx_vs[j]): str(self.tree.names[j]) for j in range(1, self.tree.njoints)}
        coupled = [
            JointCurve(f"coupling {joints[c.follower]}", joints[c.follower], joints[c.leader], (c.offset, c.ratio))
            for c in self.couplings
            if min(self.position_index[[c.follower, c.leader]]) >= 0
        ]
        return Closing(self.model, [*self.loops.loops, *coupled], self.limits, self.position_index)

    def seen_from(self, pose: pin.SE3) -> Robot:
        """A copy whose world is the frame at ``pose``: links and gravity are there as seen from that frame.

        Raises:
            ShapeError, NotFiniteError, RotationError: no pose.
        """
        model, library = self.copied_tree()
        there = validation.own_pose("pose", pose)
        away = library.SE3(there.rotation, there.translation).inverse()
        for j in range(1, model.njoints):
            if int(model.parents[j]) == 0:
                model.jointPlacements[j] = away * model.jointPlacements[j]
        for frame in model.frames:
            if int(frame.parentJoint) == 0:
                frame.placement = away * frame.placement
        turned = (away.rotation @ part for part in (model.gravity.linear, model.gravity.angular))
        model.gravity, model.inertias[0] = library.Motion(*turned), away.act(model.inertias[0])
        loops = list(self.loops.loops)
        for k, loop in enumerate(loops):
            if isinstance(loop, Loop) and WORLD in (loop.first, loop.second):  # stays where the world was
                origin = f"{loop.name}:{WORLD}"
                model.addFrame(library.Frame(origin, 0, 0, away, library.FrameType.OP_FRAME))
                first, second = (origin if end == WORLD else end for end in (loop.first, loop.second))
                loops[k] = Loop(loop.name, first, second, loop.kind)
        return changed(self, model=model, loops=replace(self.loops, loops=tuple(loops)))

    def with_limits(self, **changes: Any) -> Robot:
        """A copy with overridden limits.

        Args:
            changes: field of :class:`Limits` -> an array of nv numbers; a mapping from joint or degree-of-freedom
                name to a number (or one number a degree of freedom of that joint); or one number for every
                degree of freedom except the base's and, for positions, except those without a coordinate.

        Raises:
            UnknownNameError: no such limit, joint or degree of freedom.
            ShapeError, NotFiniteError, RangeError, BoundsError: a bad value; a finite position limit where q has no
                coordinate to limit (base, unbounded and ball joints).
        """
        arrays = {}
        for name, change in changes.items():
            validation.one_of("limit", name, [f.name for f in fields(Limits)])
            arrays[name] = self._spread(name, change)
        return changed(self, limits=replace(self.limits, **arrays))

    def _spread(self, limit: str, change: Any) -> Array:
        """One limit array of nv numbers out of what a user may write for it."""
        out = np.array(getattr(self.limits, limit))
        label = f"limits.{limit}"
        if isinstance(change, Mapping):
            for key, value in change.items():
                validation.one_of(label, key, (*self.joint_names, *self.dof_names))
                where = self.dofs(key) if key in self.joint_names else slice(*self._dof_range(key))
                width = where.stop - where.start
                shape = () if validation.dimensions(f"{label}[{key!r}]", value) == () else (width,)
                out[where] = validation.real_array(f"{label}[{key!r}]", value, shape, finite=False)
            return out
        if validation.dimensions(label, change) == ():
            number = validation.real_array(label, change, (), finite=False)
            chosen = np.arange(self.nv) >= self.base_nv
            if limit.startswith("position"):
                chosen &= self.position_index >= 0
            out[chosen] = number
            return out
        return validation.real_array(label, change, (self.nv,), finite=False)

    def _dof_range(self, name: str) -> tuple[int, int]:
        index = self.dof_names.index(name)
        return index, index + 1

    def _check_position_limits(self) -> None:
        free = self.position_index < 0
        for name in ("position_lower", "position_upper"):
            limited = np.isfinite(getattr(self.limits, name)) & free
            if limited.any():
                dof = self.dof_names[int(np.argmax(limited))]
                raise RangeError(f"limits.{name}", dof, "this degree of freedom has no single coordinate to limit")

    def with_shapes(self, shapes: Mapping[str, Sequence[PlacedShape]]) -> Robot:
        """A copy with other link shapes. Where other links have shapes than before, ``self_pairs`` must be chosen anew.

        Raises:
            UnknownNameError: a link frame that does not exist. ShapeError: no mapping of names to placed shapes.
        """
        new = {}
        for frame, placed in validation.mapping("shapes", shapes, "links to placed shapes").items():
            self.check_frame("shapes", frame)
            new[frame] = validation.items(f"shapes[{frame}]", placed, "placed shapes")
            for shape in new[frame]:
                validation.instance(f"shapes[{frame}]", shape, PlacedShape, "a PlacedShape")
        same = {k for k, v in new.items() if v} == {k for k, v in self.shapes.items() if v}
        return changed(self, shapes=new, self_pairs=self.self_pairs if same else None)

    def with_self_pairs(self, pairs: Sequence[tuple[str, str]] | None) -> Robot:
        """A copy with other pairs of links that must not touch each other.

        Raises:
            UnknownNameError: a link frame that does not exist.
            ShapeError: not pairs of names.
        """
        if pairs is None:
            return changed(self, self_pairs=None)
        chosen: list[tuple[str, str]] = []
        for pair in validation.items("self_pairs", pairs, "pairs of link names"):
            links = validation.strings("self_pairs", pair)
            if len(links) != 2:
                raise ShapeError("self_pairs", pair, "expected pairs of link names")
            chosen.append((links[0], links[1]))
        for link in dict.fromkeys(link for pair in chosen for link in pair):
            self.check_frame("self_pairs", link)
        return changed(self, self_pairs=tuple(chosen))

    @cached_property
    def fingerprint(self) -> str:
        """Hash of everything about the model that compiled code depends on."""
        h = hashlib.sha256()
        # Pinocchio's own text holds what Python cannot reach: axes of some joint types, pitches, mimic ratios, armature
        h.update(self.tree.saveToString().encode())
        for array in (
            self.limits.position_lower,
            self.limits.position_upper,
            self.limits.velocity,
            self.limits.acceleration,
            self.limits.effort,
            self.neutral,
        ):
            h.update(np.ascontiguousarray(array).tobytes())
        h.update(repr((self.base, self.couplings, self.locked_dofs, self.self_pairs, self.loops.loops)).encode())
        for basis in self.loops.bases:
            h.update(basis.tobytes())
        h.update(repr(self.passive).encode() if self.passive else b"")
        for frame, shapes in sorted(self.shapes.items()):
            for s in shapes:
                h.update(f"{frame} {s.shape} {s.excess!r}".encode() + s.place.homogeneous.tobytes())
        return h.hexdigest()


def checked_robot(robot: Any) -> Robot:
    """The robot that a user hands in.

    Raises:
        ShapeError: something else. RobotFileError: ``robot.model`` was changed in place.
    """
    return _as_read(validation.instance("robot", robot, Robot, "a wbc Robot, see wbc.robots.load"))


def _as_read(robot: Robot) -> Robot:
    """The robot, whose model is what it was."""
    handed_out = vars(robot).get(f"model{CONVERTED}")
    if isinstance(robot.tree, own.Model) and handed_out is not None and handed_out != to_pin(robot.tree):
        reason = "it was changed in place, which the robot does not see: use dataclasses.replace(robot, model=changed)"
        raise RobotFileError("robot.model", robot.name, reason)
    return robot


def changed(robot: Robot, **changes: Any) -> Robot:
    """``dataclasses.replace`` with the model as it was given, which costs no import of Pinocchio.

    Raises:
        RobotFileError: ``robot.model`` was changed in place.
    """
    return replace(_as_read(robot), **{"model": robot.tree, **changes})
