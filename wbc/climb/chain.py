"""Limbs as arrays for the compiled inner loops: turns, shifts and masses of each, and a table of sampled postures."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from wbc.climb.climber import Climber
from wbc.errors import ShapeError
from wbc.geometry.kernel import HEADERS, checked
from wbc.multibody import pin
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.native.structures import CStructures
from wbc.symbolic.joint_steps import JointKind, joint_steps, place
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

_SOURCES = Path(__file__).parent / "native"
#: Rows of a contact's pose, by what it fixes
ROWS = {"position": 3, "axis": 5, "pose": 6}
#: Structures of the C of limbs, scenes and contacts
STRUCTURES = CStructures(*(_SOURCES / name for name in ("limb.h", "stand.h")))
_StepStruct, _LimbStruct = STRUCTURES.structure("step_t"), STRUCTURES.structure("limb_t")
#: Angles of a limb for which ``native/limb.h`` has room
MOST_ANGLES = STRUCTURES.constants["MOST_ANGLES"]
#: Steps of a limb for which it has room
MOST_STEPS = STRUCTURES.constants["MOST_STEPS"]
#: Limbs for which it has room
MOST_LIMBS = STRUCTURES.constants["MOST_LIMBS"]
#: Angles of all limbs for which ``native/posture.h`` has room
MOST_IN_ALL = 96
#: Sampled postures of a limb: by the number of its angles, then for all with more
SAMPLES = {1: 64, 2: 128, 3: 256, 4: 512, 5: 1024}
SAMPLES_BEYOND = 2048
#: A joint without limits is sampled within half a turn of rest, or this far [m]
UNLIMITED_SHIFT = 1.0


@functools.lru_cache(maxsize=16)
def limb_table(climber: Climber, margin: float) -> LimbTable:
    """The table of a climber, made once."""
    return LimbTable(climber, margin)


@functools.cache
def library() -> ctypes.PyDLL:
    """The compiled code.

    Raises:
        CompileError: as of :func:`wbc.geometry.kernel.library`.
    """
    return checked(load_library(kernel(_SOURCES / "climb.c", HEADERS)), wbc_limb_size=_LimbStruct)


def address_of(array: NDArray[Any]) -> ctypes.c_void_p:
    """Where an array's numbers are, for the compiled code."""
    return ctypes.c_void_p(array.__array_interface__["data"][0])


class LimbTable:
    """All limbs of a climber in memory.

    Attributes:
        numbers: an array of the structures, limb by limb.
        lower, upper: limits of each limb's angles, less the margin [m, rad].
        rest: angles at rest.
        steps_to: of each limb how many steps there are up to and with each of its joints.
        trunk: mass, and centre of mass in the body's frame [kg, m], of all that no limb moves.

    Raises:
        ShapeError: a limb of more joints, or a climber of more limbs, than the code has room for.
    """

    def __init__(self, climber: Climber, margin: float) -> None:
        if len(climber.limbs) > MOST_LIMBS:
            raise ShapeError("Climber.limbs", len(climber.limbs), f"expected at most {MOST_LIMBS} limbs")
        self.climber = climber
        self.numbers = (_LimbStruct * len(climber.limbs))()
        self._kept: list[object] = []
        self.lower: list[Array] = []
        self.upper: list[Array] = []
        self.rest: list[Array] = []
        self.steps_to: list[list[int]] = []
        for limb in range(len(climber.limbs)):
            low, high = climber.limits[limb]
            room = np.where(np.isfinite(high - low), np.minimum(margin, 0.1 * (high - low)), 0.0)
            self.lower.append(low + room)
            self.upper.append(high - room)
            self.rest.append(np.clip(climber.angles(climber.rest, limb), low + room, high - room))
        if (total := sum(map(len, self.rest))) > MOST_IN_ALL:
            raise ShapeError("Climber.limbs", total, f"expected at most {MOST_IN_ALL} angles in all limbs")
        self.trunk = self._fill()
        for limb in range(len(climber.limbs)):
            self._sample(limb)

    def root(self, limb: int) -> Array:
        """Where a limb's first joint is in the body's frame ``(3)`` [m]."""
        step = ctypes.cast(self.numbers[limb].step, ctypes.POINTER(_StepStruct)).contents
        return np.array(step.place[9:])

    def touch(self, limb: int, angles: Array) -> Array:
        """Contact poses in the body's frame ``(n, 12)`` at some angles ``(n, k)``."""
        angles = np.ascontiguousarray(angles)
        out = np.empty((len(angles), 12))
        library().wbc_touches(
            ctypes.byref(self.numbers[limb]), ctypes.c_long(len(angles)),
            address_of(angles), address_of(out),
        )  # fmt: skip
        return out

    def _fill(self) -> Array:
        """Steps and masses of all limbs; the trunk's mass and centre."""
        model, rest = self.climber.robot.model, self.climber.rest
        data = model.createData()
        pin.forwardKinematics(model, data, rest)
        carrier = {joint: (limb, joint) for limb, chain in enumerate(self.climber.chains) for joint in chain}
        carried: dict[tuple[int, int], list[pin.Inertia]] = {}
        for joint in range(1, model.njoints):
            # What hangs on a link of a limb and is held at rest goes with that link
            on = next((carrier[int(j)] for j in reversed(list(model.supports[joint])) if int(j) in carrier), (-1, 1))
            inertia = data.oMi[on[1]].actInv(data.oMi[joint]).act(model.inertias[joint])
            carried.setdefault(on, []).append(inertia)
        totals = {on: sum(parts[1:], parts[0]) for on, parts in carried.items()}
        for limb, chain in enumerate(self.climber.chains):
            self._fill_limb(limb, chain, data, totals)
        trunk = totals[(-1, 1)]
        return np.array([trunk.mass, *trunk.lever])

    def _fill_limb(
        self, limb: int, chain: tuple[int, ...], data: pin.Data, totals: dict[tuple[int, int], pin.Inertia]
    ) -> None:
        climber, model = self.climber, self.climber.robot.model
        number_of = {int(dof): k for k, dof in enumerate(climber.joints(limb))}
        tied = {coupling.follower: coupling for coupling in climber.robot.couplings}
        steps: list[Any] = []
        before, length = 1, 0.0
        self.steps_to.append([])
        for joint in chain:
            at = pin.SE3(data.oMi[before].actInv(data.oMi[int(model.parents[joint])]) * model.jointPlacements[joint])
            before = joint
            for step in joint_steps(model, joint):
                if step.kind == JointKind.PLACE:
                    at = at * pin.SE3(step.numbers[:9].reshape(3, 3), step.numbers[9:])
                    continue
                dof = self._dof(joint, step.q)
                scale, offset = float(step.numbers[3]), float(step.numbers[4])
                if step.kind == JointKind.CIRCLE:
                    scale, offset = 1.0, 0.0
                if dof in tied:
                    scale, offset = scale * tied[dof].ratio, offset + scale * tied[dof].offset
                    dof = tied[dof].leader
                shifts = step.kind == JointKind.SHIFT
                number = number_of[dof]
                steps.append(_StepStruct(int(shifts), number, tuple(step.numbers[:3]), scale, offset, tuple(place(at))))
                if shifts:
                    length += self._span(limb, number)
                length += float(np.linalg.norm(at.translation)) if len(steps) > 1 else 0.0
                at = pin.SE3.Identity()
            self.steps_to[limb].append(len(steps))
            inertia = totals[(limb, joint)]
            # A pose after the last step of the joint moves the mass and what follows
            steps[-1].mass, steps[-1].center = inertia.mass, tuple(at * inertia.lever)
        frame = model.frames[frame_index(model, climber.limbs[limb].frame)]
        tip = data.oMi[before].actInv(data.oMi[frame.parentJoint]) * frame.placement * climber.limbs[limb].placement
        length += float(np.linalg.norm(tip.translation))
        if len(steps) > MOST_STEPS or len(number_of) > MOST_ANGLES:
            name = climber.limbs[limb].name
            raise ShapeError(f"Climber.limbs, {name}", len(number_of), f"expected at most {MOST_ANGLES} angles")
        row = self.numbers[limb]
        row.steps, row.angles, row.rows = len(steps), len(number_of), ROWS[climber.fixed(limb)]
        row.length, row.tip = length, tuple(place(tip))
        array = (_StepStruct * len(steps))(*steps)
        self._kept.append(array)
        row.step = ctypes.addressof(array)
        for name in ("lower", "upper", "rest"):
            kept = np.ascontiguousarray(getattr(self, name)[limb], dtype=np.float64)
            self._kept.append(kept)
            setattr(row, name, kept.ctypes.data)

    def _dof(self, joint: int, q: int) -> int:
        """Place in v of the coordinate that a step of a joint reads at a place in q."""
        model = self.climber.robot.model
        start, first = int(model.idx_vs[joint]), int(model.idx_qs[joint])
        return start + (q - first if int(model.nqs[joint]) == int(model.nvs[joint]) else 0)

    def _span(self, limb: int, number: int) -> float:
        ends = np.abs([self.lower[limb][number], self.upper[limb][number]])
        return float(ends.max()) if np.isfinite(ends).all() else UNLIMITED_SHIFT

    def _sample(self, limb: int) -> None:
        """Postures spread over the limits, with the contact poses that they give."""
        rest, row = self.rest[limb], self.numbers[limb]
        units = np.array(self.climber.robot.dof_units)[self.climber.joints(limb)]
        spans = np.where(units == "rad", np.pi, UNLIMITED_SHIFT)
        low = np.maximum(self.lower[limb], rest - spans)
        high = np.minimum(self.upper[limb], rest + spans)
        count = SAMPLES.get(len(rest), SAMPLES_BEYOND)
        spread = qmc.Sobol(len(rest), scramble=True, seed=0).random(count)
        angles = np.ascontiguousarray(np.vstack([rest, low + spread * (high - low)]))
        touch = self.touch(limb, angles)
        self._kept += [angles, touch]
        # Where a contact's whole pose is fixed, the place of the last joint is too
        tip = np.array(row.tip)
        wrist = -tip[:9].reshape(3, 3).T @ tip[9:] if row.rows == ROWS["pose"] else np.zeros(3)
        row.wrist = tuple(wrist)
        ends = touch[:, 9:] + touch[:, :9].reshape(-1, 3, 3) @ wrist
        away = np.linalg.norm(ends - self.root(limb), axis=1)
        row.near, row.far = float(away.min()), float(away.max())
        row.samples, row.sample, row.touch = len(angles), angles.ctypes.data, touch.ctypes.data
