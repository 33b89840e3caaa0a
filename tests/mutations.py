"""Whether the tests notice mistakes: each of these is planted in a copy of the sources, and the tests of its area run.

``python -m tests.mutations [WORD]`` says of every mistake in a file with WORD in its path which test catches it.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
COPIED = ("wbc", "tasks", "robots", "tests", "bench", "examples", "docs", "pyproject.toml")


@dataclass(frozen=True)
class Mutation:
    """A text that stands in a file once, what takes its place, and files of tests of which one must fail; of these
    only the tests that ``only`` chooses, as ``pytest -k`` does.
    """

    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]
    only: str = ""


#: Wrong formulas of items, most of them with right derivatives: file, of tasks/ where no folder is named, right, wrong,
#: and the test that must fail, where it is not the walk over the registry
FORMULAS: tuple[tuple[str, ...], ...] = (
    ("end_effector", "self.relative_to, target)\n        if axes", "self.relative_to, target.T)\n        if axes"),
    ("end_effector", "base.inverse_point(kin.position(self.frame))", "(kin.position(self.frame) - base.position)"),
    ("end_effector", "self.frame, self.relative_to, target)", 'self.frame, "world", target)'),
    ("elbow", "point(rot.constant(self.offset))\n", "point(-rot.constant(self.offset))\n"),
    ("elbow", 'size=3, rate="feedforward")', "size=3)"),
    ("_plane", "wrist - shoulder\n        arm", "shoulder - wrist\n        arm", "tasks/test_pitch_plane.py"),
    ("_stereographic", "- 2 * ca.dot(across", "- 1 * ca.dot(across", "tasks/test_pitch_plane.py"),
    ("_plane", "along = stereo.unit(line - axis * ca.dot(axis, line))", "along = line - axis * ca.dot(axis, line)"),
    (
        "posture",
        'difference(inputs["target"], kin.q,',
        'difference(ca.vertcat(inputs["target"][1:], inputs["target"][0]), kin.q,',
    ),
    ("base", "else np.array(declared, dtype=np.float64)", "else np.array(declared[::-1], dtype=np.float64)"),
    ("expression", "{d.name: inputs[d.name] for", "{d.name: ca.SX(ca.DM(d.default)) for"),
    ("braking", "(2 / acceleration) * distance", "(1 / acceleration) * distance", "constraints/test_braking.py"),
    ("_gap", "distance - a.shape.radius, -(b.pose", "distance, -(b.pose", "constraints/test_pairs.py"),
    (
        "_gap",
        "distance - (a.radius + b.radius), normal, start",
        "distance - a.radius, normal, start",
        "constraints/test_pairs.py",
    ),
    ("_nearest", "[side / 2 for side in box.size]", "[side for side in box.size]", "constraints/test_pairs.py"),
    ("_nearest", "ca.fabs(z) - cylinder.length / 2", "ca.fabs(z)", "constraints/test_pairs.py"),
    (
        "_bodies",
        'inputs["distance"] - inputs["margin"] if',
        'inputs["distance"] + 0 * inputs["margin"] if',
        "constraints/test_self_collision.py",
    ),
    ("obstacle", " + ca.vertcat(*drifts) - ", " - "),
    (
        "self_collision",
        "kin.gaps(rows) - ca.vertcat(*kept)",
        "kin.gaps(rows) + ca.vertcat(*kept)",
        "constraints/test_self_collision.py",
    ),
    ("frame_velocity_limit", "kin.rotation(self.axes).T", "kin.rotation(self.axes)"),
    ("frame_velocity_limit", "- ca.skew(arm) @", "- 0 * ca.skew(arm) @"),
    ("hold", "rot.log3(pose.rotation @ target.rotation.T)", "rot.log3(target.rotation @ pose.rotation.T)"),
    ("fixed", "lower[i] = upper[i] = rest", "lower[i - 1] = upper[i - 1] = rest", "constraints/test_fixed.py"),
    ("pitch_plane_limit", "ca.SX(self.lower + half)", "ca.SX(0)", "tasks/test_plane_reference.py"),
    ("mechanism", "= -coupling.ratio", "= coupling.ratio"),
    ("axis_align", "kin.rotation(self.relative_to).T @ rotation", "rotation"),
    ("_pointing", "ca.atan2(across, z) / across", "1.0", "tasks/test_pointing.py"),
    ("look_at", "kin.pose(self.frame).point(rot.constant(self.offset))", "kin.position(self.frame)"),
    ("look_at", " - swept[:2]", ""),
    ("distance", "point(rot.constant(self.offset))", "point(-rot.constant(self.offset))"),
    ("distance", ', rate="point_velocity")', ")"),
    ("momentum", 'ca.SX(-inputs["lag"])', 'ca.SX(-2 * inputs["lag"])'),
    (
        "relative_pose",
        "a.inverse_point(seen) - at))\n            elif",
        "a.inverse_point(seen) + at))\n            elif",
    ),
    ("relative_pose", "half.T @ (a", "(a"),
    ("relative_pose", 'unit="m", rate="feedforward")', 'unit="m")'),
    ("joint_coupling", "sum((c * kin.joint(joint)", "sum((abs(c) * kin.joint(joint)"),
    ("manipulability", "self._rows, self._length(robot))\n        error", "self._rows, 1.0)\n        error"),
    ("manipulability", 'ca.log(w / inputs["target"])', 'ca.log(w * w / inputs["target"])'),
    ("rolling", "math.sin(wheel.roller) * sideways", "math.sin(-wheel.roller) * sideways"),
    ("rolling", "- wheel.radius * upright\n    return", "+ wheel.radius * upright\n    return"),
    ("workspace_box", "self.offset, self.relative_to)", "(0, 0, 0), self.relative_to)"),
    ("_limits", "default=start, rate=rate,", "default=start,"),
    ("workspace_polyhedron", "walls.inverse_point(", "(-walls.position + "),
    ("axis_cone", ', inputs["half_angle"])', ', 2 * inputs["half_angle"])'),
    ("axis_cone", "kin.rotation(self.relative_to) @ direction", "direction"),
    ("gaze_cone", " - rot.constant(self.apex)", ""),
    ("limit", "[self._numbers(robot)]", "[: len(self._numbers(robot))]"),
    ("_limits", "ca.SX(ca.vertcat(*plain))", "ca.SX(-ca.vertcat(*plain[::-1]))"),
    ("wbc/symbolic/kinematics.py", "return moment / mass if", "return moment / (mass + 1.0) if"),
    ("wbc/symbolic/dynamics.py", "arm = pose.position - kin.center_of_mass\n", "arm = pose.position\n"),
)

#: Mistakes in central files, most of them such that one test alone looks at what they spoil: file, right, wrong, tests
CENTRAL: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("wbc/simulation/dynamics.py", "h * h / 12.0", "h * h / 24.0", ("simulation/test_pinocchio_plant.py",)),
    (
        "wbc/simulation/dynamics.py",
        "np.array([-force[1], force[0]])",
        "np.array([force[1], -force[0]])",
        ("simulation/test_pinocchio_plant.py",),
    ),
    (
        "wbc/stack/native/watch.h",
        "s->twist[i] + (w[j]",
        "s->twist[i] - (w[j]",
        ("tasks/test_moving_frames.py",),
    ),
    (
        "wbc/controller/core.py",
        "min(float(value), 1.0 / self.stack.dt_range[1])",
        "float(value)",
        ("controller/test_switches.py",),
    ),
    ("wbc/controller/ramps.py", "(3.0 - 2.0 * s)", "(2.0 - 1.0 * s)", ("controller/test_ramps.py",)),
    ("wbc/qp/equalities.py", "out.g -= rho * (d @ Q)", "out.g -= 0.0 * (d @ Q)", ("qp/test_equalities.py",)),
    ("wbc/qp/sensitivity.py", "rows.solve(-factor", "rows.solve(factor", ("qp/test_sensitivity.py",)),
    (
        "wbc/servo/laws.py",
        "rate - (self._slows * sent)",
        "rate + (self._slows * sent)",
        ("servo/test_following.py", "servo/test_policies.py"),
    ),
    (
        "wbc/tick/elastic.py",
        "np.minimum(lower[n:], at)",
        "np.minimum(lower[n:], 2.0 * at)",
        ("controller/test_policy.py",),
    ),
    ("wbc/explain/losses.py", "fall = -float(", "fall = float(", ("explain/test_explanation.py",)),
    (
        "wbc/robot/transmission.py",
        'self.matrix.T @ self._checked("torques"',
        'self.matrix @ self._checked("torques"',
        ("torque/test_motors.py", "published/test_relative_motion.py"),
    ),
    (
        "wbc/robot/carried.py",
        "appendBodyToJoint(joint, weighs, at.placement)",
        "appendBodyToJoint(joint, weighs, pin.SE3.Identity())",
        ("robots/test_carried.py",),
    ),
    (
        "wbc/trajectory/laws/certificate.py",
        "(3.0 * s[1] * s[2])",
        "(2.0 * s[1] * s[2])",
        ("trajectory/test_certificate.py",),
    ),
    (
        "wbc/trajectory/laws/between.py",
        "reach = 2.0 * (steepest",
        "reach = 0.5 * (steepest",
        ("trajectory/test_bernstein.py",),
    ),
    ("wbc/clearance/motion.py", "self.degree * np.abs(", "np.abs(", ("clearance/test_sweeps.py",)),
    (
        "wbc/symbolic/curvature.py",
        "0.5 * ca.cross(w, load.torque)",
        "ca.cross(w, load.torque)",
        ("symbolic/test_curvature.py",),
    ),
    ("wbc/symbolic/dynamics.py", "ca.SX(ca.DM(self._armature)) * self.a", "0 * self.a", ("symbolic/test_joints.py",)),
    (
        "wbc/stack/native/converge.h",
        "if (met && allowed) return WBC_FOUND;",
        "if (met) return WBC_FOUND;",
        ("ik/test_inverse_kinematics.py",),
    ),
    (
        "wbc/stack/native/certify.h",
        "value - upper_side(t, k)",
        "value - lower_side(t, k)",
        ("controller/test_backends.py",),
    ),
    (
        "wbc/batch/batch.py",
        'self._view("p")[:, slot.span], flat)',
        'self._view("p")[:, slot.span], flat[::-1])',
        ("batch/test_batch.py",),
    ),
    (
        "wbc/shapes/convex.py",
        "spread(self.points - self.center",
        "spread(self.points + self.center",
        ("proximity/test_corners.py",),
    ),
    ("wbc/ik/continuation.py", "max(self.moved, moved)", "moved", ("ik/test_continuation.py",)),
)

MUTATIONS = (
    Mutation(
        "wbc/stack/program.py",
        "total = total + ca.jacobian(expression, self.p[slot.span]) @ self.rate(owner, slot)",
        "total = total - ca.jacobian(expression, self.p[slot.span]) @ self.rate(owner, slot)",
        ("controller/test_qp_referee.py",),
    ),
    Mutation(
        "wbc/stack/native/assemble.h",
        "t->H[i * WIDE + i] = damping[i];",
        "t->H[i * WIDE + i] = 2.0 * damping[i];",
        ("controller/test_qp_referee.py", "controller/test_backends.py"),
    ),
    # Only in libraries of one stack
    Mutation(
        "wbc/stack/codegen.py",
        "single(t, {row}, {count}, {first});",
        "single(t, {row}, {count} - 1, {first});",
        ("stack/test_generic.py",),
    ),
    Mutation(
        "wbc/stack/native/balls.h",
        "center[1] * n[2] - center[2] * n[1]",
        "center[1] * n[2] + center[2] * n[1]",
        ("controller/test_balls.py",),
    ),
    Mutation(
        "wbc/stack/native/balls.h",
        "length[c] - row_reach[r] - margin;",
        "length[c] - row_reach[r] + margin;",
        ("controller/test_balls.py",),
    ),
    Mutation(
        "wbc/stack/native/balls.h",
        "t->p[ball_pose[b] + 9 + i] + velocity[i] * t->dt",
        "t->p[ball_pose[b] + 9 + i] - velocity[i] * t->dt",
        ("controller/test_balls.py",),
    ),
    Mutation(
        "wbc/qp/certificate.py",
        "total = np.abs(exact - x)",
        "total = 0.5 * np.abs(exact - x)",
        ("qp/test_certificate.py",),
    ),
    Mutation(
        "wbc/symbolic/kinematics.py",
        "known = base.times(Pose(rotation, position))",
        "known = Pose(base.rotation @ rotation, base.position + position)",
        ("symbolic/test_joints.py", "symbolic/test_robots.py"),
    ),
    Mutation("tasks/end_effector.py", "return target.T @ phi", "return target @ phi", ("tasks/test_values.py",)),
    Mutation(
        "tasks/braking.py",
        "(2 / acceleration) * distance",
        "(1 / acceleration) * distance",
        ("constraints/test_joint_limits.py", "constraints/test_joint_limits_adversary.py"),
    ),
    Mutation(
        "wbc/trajectory/laws/timing.py",
        "0.5 * np.diff(speeds)",
        "0.4 * np.diff(speeds)",
        ("trajectory/test_timing.py",),
    ),
    Mutation(
        "wbc/climb/checker/clearances.py",
        "bound = 0.5 * (sum(ends) - (y - x) * travel[k])",
        "bound = 0.5 * (sum(ends) + (y - x) * travel[k])",
        ("climb/test_checker_faults.py",),
    ),
    Mutation(
        "wbc/climb/checker/checking.py",
        "moved - np.maximum(off[0] - off, 0.0)",
        "0.2 * moved",
        ("climb/test_checker_faults.py",),
    ),
    Mutation(
        "wbc/climb/native/balance.h",
        "slack += cost[basis[j]] * z;",
        "slack += 1.01 * cost[basis[j]] * z;",
        ("climb/test_balance.py",),
        "whole_program",
    ),
    Mutation(
        "wbc/climb/along/body_track.py",
        "out.append(out[-1] + max(way",
        "out.append(out[-1] + min(way",
        ("climb/test_published.py",),
        "turn_on_the_spot or too_fast",
    ),
    Mutation(
        "wbc/climb/grids.py",
        "radians(25.0 + 5.0 * t)",
        "radians(25.0 + 5.1 * t)",
        ("published/test_three_arm_walker_model.py",),
    ),
    Mutation(
        "wbc/geometry/native/shapes.h",
        "out[k] = copysign(a->size[k], d[k]);",
        "out[k] = a->size[k];",
        ("proximity/test_exact.py",),
    ),
    Mutation(
        "wbc/geometry/native/pieces.h",
        "out->gap = fmin(-lift * cosine, 0.0);",
        "out->gap = fmin(-lift, 0.0);",
        ("geometry/test_height_map.py",),
    ),
    Mutation("wbc/ik/descent.py", "if met and allowed:", "if met:", ("ik/test_inverse_kinematics.py",)),
    Mutation(
        "wbc/log/file.py",
        "np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[:, part] for rows in self.chunks())])",
        "np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[::-1, part] for rows in self.chunks())])",
        ("record/test_recording.py",),
    ),
    Mutation(
        "wbc/coordinates/control/integrals.py", "@ (0.5 * step)", "@ (0.6 * step)", ("coordinates/test_drift.py",)
    ),
    *(
        Mutation(file if "/" in file else f"tasks/{file}.py", right, wrong, tuple(tests) or ("tasks/test_registry.py",))
        for file, right, wrong, *tests in FORMULAS
    ),
    *(Mutation(*mistake) for mistake in CENTRAL),
)


def caught(root: Path, mutation: Mutation) -> str:
    """The first test that fails where the mistake is planted, or an empty text."""
    file = root / mutation.file
    text = file.read_text()
    if text.count(mutation.right) != 1:
        raise SystemExit(
            f"{mutation.file}: {mutation.right!r} stands there {text.count(mutation.right)} times, not once"
        )
    file.write_text(text.replace(mutation.right, mutation.wrong))
    try:
        command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider"]
        command += [*(f"tests/{name}" for name in mutation.tests), "-k", mutation.only]
        done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    finally:
        file.write_text(text)
    found = re.search(r"^FAILED tests/(.+?)(?: - .*)?$", done.stdout, re.MULTILINE)
    # Neither passed nor failed: the tests did not run at all
    if (done.returncode, found is None) not in ((0, True), (1, False)):
        raise SystemExit(f"{mutation.file}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return found[1] if found else ""


def main(word: str = "") -> int:
    """How many survive."""
    survived = 0
    with tempfile.TemporaryDirectory(prefix="wbc-mutations-") as folder:
        root = Path(folder)
        for name in COPIED:
            if (ROOT / name).is_dir():
                shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(ROOT / name, root / name)
        # As they install
        for name in ("tasks", "robots"):
            os.symlink(root / name, root / "wbc" / name)
        for mutation in MUTATIONS:
            if word in mutation.file:
                by = caught(root, mutation)
                survived += not by
                print(f"{mutation.file}: {mutation.wrong!r}: {by or 'SURVIVED'}", flush=True)
    return survived


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
