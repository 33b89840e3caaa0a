"""A model made of a ``mujoco.MjModel`` beside what MuJoCo itself computes, in random states of the robot's joints.

Poses, inertias and bias forces must be alike. Passive forces and residuals of equalities tell what a robot does not
hold, and how much of it: springs, compensated gravity, fluids; loops that may open.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from wbc.multibody import mass_matrix, own
from wbc.robot.sources.mjnames import FREE, HINGE, SIZES, MjNames, coordinates, held_bodies
from wbc.rotations import TO_PINOCCHIO
from wbc.validation import Array

if TYPE_CHECKING:
    import mujoco

    from wbc.robot.sources.description import Mimic

#: Random states that are looked at
SAMPLES = 16
#: What is alike differs by at most this part of the largest number, and passive forces above it are forces
NEAR = 1e-9
#: An angle or a way beyond this leaves fewer digits for what depends on it [rad or m]
MANY = 1e4
#: Ranges that are wider than this say that there is none [m or rad]
WIDE = 100.0
#: Names that a sentence has room for
_SHOWN = 8
#: Passive forces that MuJoCo keeps apart, and their name
_FORCES = {
    "qfrc_spring": "springs",
    "qfrc_gravcomp": "compensated gravity",
    "qfrc_fluid": "fluid",
    "damper": "damping that is not linear",
    "other": "plugins",
}


def shown(names: Iterable[str]) -> str:
    """The names, or the first of many and how many more."""
    every = list(names)
    more = f" and {len(every) - _SHOWN} more" if len(every) > _SHOWN else ""
    return ", ".join(every[:_SHOWN]) + more


def sentence(words: str, names: Iterable[str]) -> str:
    """The words and the names that they are said of, "" where there is none."""
    found = shown(names)
    return f"{words}: {found}" if found else ""


class MjCompared:
    """What MuJoCo and Pinocchio say of one robot.

    Args:
        model: not changed. whole: the robot made of it, before it gets another base.
        order: MuJoCo's joints in the order of q. names, mimics: as read.
    """

    def __init__(
        self, model: mujoco.MjModel, whole: own.Model, order: Sequence[int], names: MjNames, mimics: Sequence[Mimic]
    ) -> None:
        import mujoco

        self._model, self._whole, self._order, self._names, self._mimics = copy.copy(model), whole, order, names, mimics
        # Geoms that touch are no matter here, nor what MuJoCo does with time steps
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self._model.opt.enableflags, self._model.opt.integrator = 0, int(mujoco.mjtIntegrator.mjINT_EULER)
        self._data, self._rng = mujoco.MjData(self._model), np.random.default_rng(0)
        widths = [int(whole.nvs[k]) for k in range(1, whole.njoints)]
        starts = [int(model.jnt_dofadr[j]) for j in order]
        #: MuJoCo's degrees of freedom in the order of v, and the joint of each
        self._dofs = np.concatenate([at + np.arange(n) for at, n in zip(starts, widths, strict=True)])
        self._joint_of = np.repeat([names.joints[j] for j in order], widths)

    def difference(self) -> str:
        """Where the two say different things of poses, masses or bias forces at a random state; "" where nowhere."""
        import mujoco

        model, data, whole, dofs = self._model, self._data, self._whole, self._dofs
        q, axes = self._draw()
        far = max(1.0, float(np.abs(q).max()) / MANY)
        here = whole.createData()
        own.framesForwardKinematics(whole, here, q)
        for frame, pose in zip(whole.frames, here.oMf, strict=True):
            body = frame.type == own.FrameType.BODY
            if not body and frame.type != own.FrameType.OP_FRAME:
                continue
            index = (self._names.bodies if body else self._names.sites).index(str(frame.name))
            place, turn = (data.xpos, data.xmat) if body else (data.site_xpos, data.site_xmat)
            gap = np.abs(pose.homogeneous[:3] - np.column_stack([turn[index].reshape(3, 3), place[index]])).max()
            if gap > NEAR * max(far, float(np.abs(place[index]).max())):
                return f"{frame.name} is {gap:.3g} m or rad from where MuJoCo has it"
        ours, theirs = axes @ mass_matrix(whole, here, q) @ axes.T, np.zeros((whole.nv, whole.nv))
        for row, dof in zip(theirs, dofs.tolist(), strict=True):
            pushed = np.zeros(model.nv)
            mujoco.mj_mulM(model, data, pushed, np.eye(model.nv)[dof])
            row[:] = pushed[dofs]
        forces, weights = np.array(data.qfrc_bias[dofs]), np.sqrt(np.diag(theirs))
        bias = axes @ own.nonLinearEffects(whole, here, q, axes.T @ data.qvel[dofs])
        largest = max(float(np.abs(theirs).max()), float(np.abs(forces).max()))
        gaps = {
            "inertia": (np.abs(ours - theirs) / np.outer(weights, weights)).max(axis=1),
            "bias force": np.abs(bias - forces) / largest,
        }
        for what, gap in gaps.items():
            if gap.max() > NEAR * far:
                why = f"; armature of tendons: {shown(self._armed())}" if self._armed() else ""
                joint = self._joint_of[int(gap.argmax())]
                return f"no robot can have the {what} that MuJoCo has at joint {joint}, off by {gap.max():.3g}{why}"
        return ""

    def _armed(self) -> list[str]:
        """Tendons with an armature, their own or one of an actuator."""
        import mujoco

        model = self._model
        armed = set(np.flatnonzero(model.tendon_armature).tolist())
        for a, armature in enumerate(getattr(model, "actuator_armature", ())):
            if armature and model.actuator_trntype[a] == int(mujoco.mjtTrn.mjTRN_TENDON):
                armed.add(int(model.actuator_trnid[a, 0]))
        return [str(model.tendon(t).name) or f"tendon {t}" for t in sorted(armed)]

    @cached_property
    def _sampled(self) -> tuple[dict[str, Array], dict[int, Array]]:
        """(largest passive forces by kind and degree of freedom, largest residuals of active equalities)."""
        import mujoco

        model, data = self._model, self._data
        forces = {kind: np.zeros(len(self._dofs)) for kind in _FORCES}
        residuals: dict[int, Array] = {}
        linear = np.zeros(model.nv)
        linear[self._dofs] = self._whole.damping
        compensated = np.isin(model.dof_jntid, np.flatnonzero(model.jnt_actgravcomp))
        for _ in range(SAMPLES):
            self._draw()
            found = {kind: np.array(getattr(data, kind)) for kind in _FORCES if kind.startswith("qfrc")}
            found["damper"] = data.qfrc_damper + linear * data.qvel
            rest = data.qfrc_passive - data.qfrc_spring - data.qfrc_damper - data.qfrc_fluid
            found["other"] = rest - np.where(compensated, 0.0, data.qfrc_gravcomp)
            for kind, values in found.items():
                np.maximum(forces[kind], np.abs(values[self._dofs]), out=forces[kind])
            kinds, ids = np.array(data.efc_type[: data.nefc]), np.array(data.efc_id[: data.nefc])
            equal = kinds == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
            for k in np.unique(ids[equal]).tolist():
                gap = self._gap(k, np.array(data.efc_pos[: data.nefc])[equal & (ids == k)])
                residuals[k] = np.maximum(residuals.get(k, gap), gap)
        return forces, residuals

    def forces(self) -> dict[str, str]:
        """What pushes the joints in MuJoCo and is no part of a robot, or ""."""
        parts = []
        for kind, largest in self._sampled[0].items():
            on = largest > NEAR * max(1.0, float(largest.max()))
            if on.any():
                where = shown(dict.fromkeys(self._joint_of[on].tolist()))
                parts.append(f"{_FORCES[kind]} on {where} (up to {largest.max():.3g} N m or N)")
        return {"forces": f"forces that are not held: {'; '.join(parts)}" if parts else ""}

    def loops(self, equalities: Sequence[int], bodies: set[int]) -> dict[str, str]:
        """Which equalities of the robot's bodies and joints are not kept, and how far each opens, or ""."""
        import mujoco

        model, parts = self._model, []
        for k in equalities:
            kind, ends = int(model.eq_type[k]), (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
            word = mujoco.mjtEq(kind).name.removeprefix("mjEQ_").lower()
            if word in ("connect", "weld"):
                ours = bodies & {*held_bodies(model, k)}
            elif word in ("joint", "tendon"):
                ours = set(ends) & set(self._order) if word == "joint" else {0}
            else:
                ours = bodies & {int(model.flex_vertbodyid[model.flex_vertadr[ends[0]]])}
            if not ours:
                continue
            name = str(model.eq(k).name) or f"equality {k}"
            gap = self._sampled[1].get(k, np.zeros(1))
            far = f"{gap[0]:.3g} {'m or rad' if word in ('joint', 'tendon') else 'm'}"
            far += f" and {gap[1]:.3g} rad" if len(gap) > 1 else ""
            parts.append(f"{word} {name!r} (opens by up to {far})")
        where = f"in {SAMPLES} random postures"
        return {"mimic": f"loops that are not kept closed, {where}: {'; '.join(parts)}" if parts else ""}

    def _gap(self, k: int, rows: Array) -> Array:
        """(distance [m], angle [rad]) that an equality is open by; the angle for a weld alone."""
        import mujoco

        if int(self._model.eq_type[k]) != int(mujoco.mjtEq.mjEQ_WELD) or len(rows) != 6:
            return np.array([np.linalg.norm(rows)])
        # The rows of a weld's rotation are sin(angle / 2) along its axis, times a scale
        scale = float(self._model.eq_data[k, 10])
        sine = float(np.linalg.norm(rows[3:])) / scale if scale else 0.0
        return np.array([np.linalg.norm(rows[:3]), 2.0 * np.arcsin(min(sine, 1.0))])

    def _draw(self) -> tuple[Array, Array]:
        """(q, axes): a random state within ranges, where free bodies do not move along; qvel = axes v."""
        import mujoco

        model, data, rng, axes = self._model, self._data, self._rng, np.eye(self._whole.nv)
        mujoco.mj_resetData(model, data)
        places = dict(zip(self._names.joints, model.jnt_qposadr.tolist(), strict=True))
        for k, j in enumerate(self._order, start=1):
            at, dof, kind = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j]), int(model.jnt_type[j])
            numbers, size = SIZES[kind]
            data.qvel[dof : dof + size] = rng.uniform(-1.0, 1.0, size)
            if size == 1:
                reach = np.pi if kind == HINGE else 1.0
                low, high = model.qpos0[at] - reach, model.qpos0[at] + reach
                if model.jnt_limited[j]:
                    low, high = max(low - WIDE, model.jnt_range[j, 0]), min(high + WIDE, model.jnt_range[j, 1])
                data.qpos[at] = rng.uniform(low, high)
                continue
            turn = rng.normal(size=4)
            data.qpos[at + numbers - 4 : at + numbers] = turn / np.linalg.norm(turn)
            if kind == FREE:
                data.qpos[at : at + 3], data.qvel[dof : dof + 3] = rng.uniform(-1.0, 1.0, 3), 0.0
                turned, first = own.Quaternion(data.qpos[at + 3 : at + 7][TO_PINOCCHIO]), int(self._whole.idx_vs[k])
                axes[first : first + 3, first : first + 3] = turned.toRotationMatrix()
        for mimic in reversed(self._mimics):
            data.qpos[places[mimic.follower]] = mimic.ratio * data.qpos[places[mimic.leader]] + mimic.offset
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        return np.concatenate([coordinates(model, j, data.qpos) for j in self._order]), axes
