"""Small models of one joint type each, with random placements, masses and armature."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from tests.random_robots import random_inertia, random_pose

#: A unit axis that is no coordinate axis.
SLANTED = np.array([0.48, -0.6, 0.64])
#: A unit axis at a right angle to it.
ACROSS = np.array([0.8, 0.0, -0.6])


def chain(joints: Sequence[pin.JointModel], seed: int = 0) -> pin.Model:
    """Joints in series; a frame at the end, and a branch at the first joint."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    parent = 0
    for k, joint in enumerate(joints):
        parent = model.addJoint(parent, joint, random_pose(rng), f"joint{k}")
        model.appendBodyToJoint(parent, random_inertia(rng), random_pose(rng))
    model.addFrame(pin.Frame("tip", parent, 0, random_pose(rng), pin.FrameType.OP_FRAME))
    branch = model.addJoint(1, pin.JointModelRY(), random_pose(rng), "branch")
    model.appendBodyToJoint(branch, random_inertia(rng), random_pose(rng))
    model.addFrame(pin.Frame("branch_tip", branch, 0, random_pose(rng), pin.FrameType.OP_FRAME))
    model.armature = rng.uniform(0.1, 1.0, model.nv)
    return model


def composite(*parts: pin.JointModel, seed: int = 3) -> pin.JointModelComposite:
    """A composite joint with random placements between its parts."""
    rng = np.random.default_rng(seed)
    out = pin.JointModelComposite()
    for part in parts:
        out.addJoint(part, random_pose(rng))
    return out


def unaligned_unbounded(direction: Sequence[float] = tuple(SLANTED)) -> pin.Model:
    """Continuous joints about a slanted axis: only a description makes this type in Python."""
    moments = '<inertia ixx="1" iyy="2" izz="2.5" ixy=".1" ixz="0" iyz="0"/>'
    link = f'<inertial><origin xyz=".1 .2 .3"/><mass value="2"/>{moments}</inertial>'
    axis = " ".join(str(float(c)) for c in direction)
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<axis xyz="{axis}"/><origin xyz=".4 -.2 .3" rpy=".3 .2 .1"/></joint>'
        for k in range(2)
    )
    links = "".join(f'<link name="l{k}">{link}</link>' for k in range(3))
    return pin.buildModelFromXML(f'<robot name="continuous">{links}{joints}</robot>')


#: Joint types under test, by name; a fresh joint each time.
KINDS: dict[str, Callable[[], pin.JointModel]] = {
    **{
        name: getattr(pin, f"JointModel{name}") for name in ("RX", "RY", "RZ", "RUBX", "RUBY", "RUBZ", "PX", "PY", "PZ")
    },
    **{name: getattr(pin, f"JointModel{name}") for name in ("FreeFlyer", "Planar", "Spherical", "Translation")},
    "SphericalZYX": pin.JointModelSphericalZYX,
    "RevoluteUnaligned": lambda: pin.JointModelRevoluteUnaligned(SLANTED),
    "PrismaticUnaligned": lambda: pin.JointModelPrismaticUnaligned(SLANTED),
    "HX": lambda: pin.JointModelHX(0.3),
    "HY": lambda: pin.JointModelHY(-0.2),
    "HZ": lambda: pin.JointModelHZ(0.1),
    "HelicalUnaligned": lambda: pin.JointModelHelicalUnaligned(SLANTED, 0.25),
    "Universal": lambda: pin.JointModelUniversal(SLANTED, ACROSS),
    "Composite revolute": lambda: composite(pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()),
    "Composite mixed": lambda: composite(
        pin.JointModelPX(), pin.JointModelRUBY(), pin.JointModelSpherical(), pin.JointModelSphericalZYX()
    ),
    "Composite nested": lambda: composite(
        pin.JointModelRZ(),
        composite(pin.JointModelPlanar(), pin.JointModelHX(0.3), seed=4),
        pin.JointModelTranslation(),
    ),
}
#: Those whose motion subspace depends on q; Pinocchio's derivatives of inverse dynamics take it as constant.
VARYING = frozenset({"SphericalZYX", "Universal"} | {name for name in KINDS if name.startswith("Composite")})
