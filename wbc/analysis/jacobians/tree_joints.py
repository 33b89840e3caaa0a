"""Blocks of the joints of a tree: which rows of a Jacobian share no joint once known twists are taken off."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from wbc.analysis.jacobians.equivalent_rows import whole_twist
from wbc.analysis.rows import BodyRows, JointRows, Rows, checked
from wbc.errors import RangeError
from wbc.robot import Robot
from wbc.robot.robot import checked_robot
from wbc.symbolic.kinematics import joint_of


@dataclass(frozen=True)
class JointBlock:
    """Joints whose columns meet no row of other joints.

    Attributes:
        joints: their names, in the order of v. rows: the declarations that are theirs.
    """

    joints: tuple[str, ...]
    rows: tuple[Rows, ...]

    def __str__(self) -> str:
        return self.joints[0] if len(self.joints) == 1 else f"{self.joints[0]} ... {self.joints[-1]}"


class TreeJoints:
    """Which joints of a fixed tree declarations depend on."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self._model = robot, robot.model

    def name(self, joint: int) -> str:
        """Of a joint by its number."""
        return str(self._model.names[joint])

    def number(self, joint: str) -> int:
        """Of a joint by its name."""
        self.robot.dofs(joint)
        return int(self._model.getJointId(joint))

    def carrier(self, frame: str) -> int:
        """The joint that moves a frame; 0: none."""
        return joint_of(self._model, self.robot.check_frame("frame", frame))

    def support(self, joint: int) -> frozenset[int]:
        """Joints between the world and a joint, itself included."""
        return frozenset(int(j) for j in self._model.supports[joint] if j)

    def segments(self) -> list[frozenset[int]]:
        """Runs of joints without a fork between them."""
        below = {j: [k for k in range(1, self._model.njoints) if self._model.parents[k] == j] for j in self._all()}
        out: dict[int, list[int]] = {}
        start: dict[int, int] = {}
        for j in self._all()[1:]:
            parent = int(self._model.parents[j])
            start[j] = start[parent] if parent and len(below[parent]) == 1 else j
            out.setdefault(start[j], []).append(j)
        return [frozenset(run) for run in out.values()]

    def forks(self) -> frozenset[int]:
        """Joints that carry several others."""
        parents = [int(self._model.parents[j]) for j in self._all()[1:]]
        return frozenset(j for j in parents if j and parents.count(j) > 1)

    def known(self, rows: Sequence[Rows]) -> frozenset[int]:
        """Joints whose bodies' twists are sums of the rows: declared whole, or carriers with every joint locked."""
        declared = {self.carrier(r.frame) for r in rows if whole_twist(r)}
        locked = {self.number(r.joint) for r in rows if isinstance(r, JointRows)}
        return frozenset(declared | {j for j in self.forks() if self.support(j) <= locked}) - {0}

    def joints_of(self, rows: Rows, known: frozenset[int]) -> frozenset[int]:
        """Joints in the columns and in the values of a declaration, after known twists of bodies before are taken off.

        The velocity of a frame relative to the body of a known twist is the frame's own less a sum of that twist's
        rows, so that the joints before that body drop out:

            v_f - (v_t + omega_t x (f - t)),    omega_f - omega_t
        """
        if isinstance(rows, JointRows):
            return frozenset({self.number(rows.joint)})
        if isinstance(rows, BodyRows):
            moved = self.support(self.carrier(rows.frame))
            base = self.support(self.carrier(rows.base)) or self._before(moved, known)
            axes = set() if rows.expressed is None else moved ^ self.support(self.carrier(rows.expressed))
            partial = len(rows.translation) in (1, 2) or len(rows.rotation) in (1, 2)
            return (moved ^ base) | (axes if partial else frozenset())
        shoulder, wrist = (self.support(self.carrier(f)) for f in (rows.shoulder, rows.wrist))
        return (shoulder - self._before(shoulder, known)) | (shoulder ^ wrist)

    def _before(self, support: frozenset[int], known: frozenset[int]) -> frozenset[int]:
        """The longest support of a known body before a frame, or none."""
        found = [self.support(j) for j in known if self.support(j) < support]
        return max(found, key=len, default=frozenset())

    def _all(self) -> range:
        return range(self._model.njoints)


def joint_blocks(robot: Robot, rows: Sequence[Rows]) -> tuple[JointBlock, ...]:
    """The finest blocks of a tree robot's joints that its rows allow, in the order of the joints.

    With the twists of carrying bodies taken off where the rows contain them, J_R is block diagonal up to the order of
    rows and columns, so rank J_R is the sum of the ranks of the blocks.

    Source: E. Dupuis, PhD thesis, McGill University, 2001, section 4.5, eq. 4.48.

    Raises:
        ShapeError: no robot, or no rows.
        RangeError: a row that ties runs of joints together, named with what would part them; joints without a row.
        UnknownNameError: no such frame or joint.
    """
    rows, tree = checked("rows", rows), TreeJoints(checked_robot(robot))
    known = tree.known(rows)
    found = [(declared, tree.joints_of(declared, known)) for declared in rows]
    segments = tree.segments()
    for declared, joints in found:
        if not joints:
            raise RangeError("rows", str(declared), "no joint moves it")
        spanned = [run for run in segments if run & joints]
        if len(spanned) > 1:
            names = ", ".join(tree.name(min(run & joints)) for run in spanned)
            forks = ", ".join(tree.name(j) for j in sorted(tree.forks() - known)) or "none"
            reason = (
                f"depends on several runs of joints (from {names} on), so there are no blocks; expected rows relative "
                f"to the body that carries an arm, or among the rows all six of a frame on it, or all its locks; "
                f"carriers without them: {forks}"
            )
            raise RangeError("rows", str(declared), reason)
    blocks = _merged(joints for _, joints in found)
    free = set(range(1, robot.model.njoints)).difference(*blocks)
    if free:
        raise RangeError("rows", tree.name(min(free)), "no row depends on this joint")
    return tuple(
        JointBlock(tuple(tree.name(j) for j in sorted(block)), tuple(r for r, joints in found if joints <= block))
        for block in sorted(blocks, key=min)
    )


def _merged(sets: Iterable[frozenset[int]]) -> list[frozenset[int]]:
    """Unions of sets that meet."""
    out: list[frozenset[int]] = []
    for one in sets:
        meeting = [other for other in out if other & one]
        out = [other for other in out if not other & one] + [one.union(*meeting)]
    return out
