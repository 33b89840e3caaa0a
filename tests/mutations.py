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
    """A text that stands in a file once, what takes its place, and files of tests of which one must fail."""

    file: str
    right: str
    wrong: str
    tests: tuple[str, ...]


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
        "wbc/walking/planner/fewest.py",
        "out[grip] = 1 + out[after]",
        "out[grip] = 2 + out[after]",
        ("walking/test_fewest_regrasps.py",),
    ),
    Mutation(
        "wbc/walking/checker/clearances.py",
        "y.a[rows], y.b[rows]) - r",
        "y.a[rows], y.b[rows])",
        ("walking/test_checker.py", "walking/test_checker_parts.py"),
    ),
    Mutation(
        "wbc/proximity/native/shapes.h",
        "out[k] = copysign(a->size[k], d[k]);",
        "out[k] = a->size[k];",
        ("proximity/test_distances.py",),
    ),
    Mutation("wbc/ik/descent.py", "if met and allowed:", "if met:", ("ik/test_inverse_kinematics.py",)),
    Mutation(
        "wbc/record/recording.py",
        "np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[:, part] for rows in self.chunks())])",
        "np.concatenate([np.zeros((0, part.stop - part.start)), *(rows[::-1, part] for rows in self.chunks())])",
        ("record/test_recording.py",),
    ),
    Mutation(
        "wbc/coordinates/control/integrals.py", "@ (0.5 * step)", "@ (0.6 * step)", ("coordinates/test_drift.py",)
    ),
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
        command += [f"tests/{name}" for name in mutation.tests]
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
                print(f"{mutation.file}: {by or 'SURVIVED'}", flush=True)
    return survived


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
