"""Exported C in single precision beside double: ``python -m tests.export.single`` with random robots and stacks.

Every case is exported with DAQP's source, built by gcc with WBC_SINGLE, and stepped through states of runs in closed
loop; half of the cases have targets and obstacles anywhere, so that rows contradict each other. Ends with 1 where a
status differs. DAQP's source comes from the package index unless --archive names it; where it or a program is missing,
that is said, with exit code 3.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pinocchio as pin

import wbc
from bench.pool import ROOT
from tests.soak.machines import machine
from tests.soak.stacks import pose
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.errors import WbcError
from wbc.export.exporting import RUN, SAME, vectors
from wbc.export.folder import MARK
from wbc.export.solver_code import SolverSourceError
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere
from wbc.tasks import Damping, EndEffector, FrameVelocityLimit, Hold, JointLimits, Obstacle, Posture, WorkspaceBox
from wbc.tick.outcome import STATUSES
from wbc.validation import Array

#: Exit code where something that is needed is not installed
MISSING = 3
PROGRAM = ROOT / "bench" / "cortex_m7" / "states.c"
SINGLE = "-DWBC_SINGLE -DDAQP_SINGLE_PRECISION -fsingle-precision-constant"
#: Of the random cases, which are not made to be timed
UNOPTIMISED = ("ROWS_FLAGS=-O0", "TICK_FLAGS=-O1")
ARMS = (
    "panda",
    "panda_collision",
    "ur5",
    "ur3",
    "ur10",
    "xarm7",
    "z1",
    "kinova",
    "so101",
    "talos_left_arm",
    "ur5_limited",
)
#: Every third case is a random robot
KINDS = 3


class MissingProgramError(WbcError):
    """A program that a measurement needs is not on the PATH."""


class BuildError(WbcError):
    """A program that was run failed."""


@dataclass(frozen=True)
class Ticks:
    """What a build answered: status, instructions [n], commands [n, nv] [rad/s, m/s]; bytes of memory and of stack."""

    status: Array
    instructions: Array
    v: Array
    memory: int
    stack: int


@dataclass(frozen=True)
class States:
    """Rows of q, v measured, run-time inputs, status and command in double precision."""

    rows: Array
    nq: int
    nv: int

    @property
    def status(self) -> Array:
        """[n]."""
        return self.rows[:, -1 - self.nv]

    @property
    def v(self) -> Array:
        """Commands [n, nv]."""
        return self.rows[:, -self.nv :]

    def write(self, path: Path) -> None:
        """As check.bin is written."""
        inputs = self.rows.shape[1] - self.nq - 2 * self.nv - 1
        head = [MARK, len(self.rows), self.nq, self.nv, inputs, SAME]
        np.concatenate([head, self.rows.ravel()]).astype("=f8").tofile(path)


def need(*programs: str) -> None:
    """Refuse to begin without them.

    Raises:
        MissingProgramError: one is not on the PATH.
    """
    for program in programs:
        if shutil.which(program) is None:
            raise MissingProgramError("program", program, "is not on the PATH, nothing was measured")


def run(*command: str | Path, folder: Path) -> str:
    """What a command prints.

    Raises:
        BuildError: it failed.
    """
    done = subprocess.run([str(c) for c in command], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError("command", " ".join(map(str, command)), f"failed: {done.stdout}{done.stderr}")
    return done.stdout


def compiled(folder: Path, compiler: str, precision: str, *flags: str) -> None:
    """Both libraries of an export."""
    run("make", "clean", folder=folder)
    run("make", "libwbc_tick.a", "libdaqp.a", f"CC={compiler}", f"PRECISION={precision}", *flags, folder=folder)


def read(text: str) -> Ticks:
    """What states.c printed."""
    _, *lines, last = text.splitlines()
    table = np.array([[float(word) for word in line.split()] for line in lines])
    _, memory, _, stack = last.split()
    return Ticks(table[:, 0], table[:, 1], table[:, 2:], int(memory), int(stack))


def build_here(folder: Path, precision: str, *flags: str) -> None:
    """The program of an export on this machine."""
    compiled(folder, "gcc", precision, *flags)
    words = [*precision.split(), "-std=gnu99", "-O2", "-I.", PROGRAM, "libwbc_tick.a", "libdaqp.a"]
    run("gcc", *words, "-lm", "-o", "states", folder=folder)


def ticks_here(folder: Path, states: States) -> Ticks:
    """Its answers."""
    states.write(folder / "states.bin")
    return read(run("./states", "states.bin", folder=folder))


def in_closed_loop(c: Controller, count: int, seed: int) -> States:
    """States of runs with targets and obstacles anywhere: rows bind, contradict each other and give way."""
    rng, robot = np.random.default_rng(seed), c.stack.robot
    rows: list[Array] = []
    low, high = robot.limits.position_lower, robot.limits.position_upper
    for k in range(count):
        if k % RUN == 0:
            q: Array = pin.integrate(robot.model, robot.neutral, rng.uniform(-1.0, 1.0, robot.nv))
            for i, at in enumerate(robot.position_index):
                if at >= 0 and np.isfinite(high[i] - low[i]):
                    q[at] = rng.uniform(0.9 * low[i] + 0.1 * high[i], 0.1 * low[i] + 0.9 * high[i])
            v = 0.05 * rng.normal(size=robot.nv)
            _place(c, rng)
        step = c.step(q, v)
        rows.append(np.concatenate([q, v, core_of(c).tick.p, [STATUSES.index(step.status)], step.command]))
        q, v = pin.integrate(robot.model, q, step.v * c.stack.dt), step.v.copy()
    return States(np.array(rows), robot.nq, robot.nv)


def _place(c: Controller, rng: np.random.Generator) -> None:
    """Targets and obstacles somewhere."""
    for entry in c.stack.entries:
        item, handle = entry.item, c[entry.name]
        if isinstance(item, (EndEffector, Hold)):
            place = pose(rng, 0.5)
            kind = core_of(c).layout.blocks[entry.name].slots["target"].input.kind
            handle.target = {"pose": place, "rotation": place.rotation, "vector": place.translation}[kind]
        elif isinstance(item, Obstacle):
            handle.pose = pose(rng, 0.6)
            handle.velocity = np.concatenate([rng.normal(0.0, 0.5, 3), np.zeros(3)])
        elif isinstance(item, Posture):
            handle.target = c.stack.robot.neutral


def random_robot(seed: int, rng: np.random.Generator) -> Robot:
    """A known arm, or a random chain without a base that moves."""
    while seed % KINDS == 2:
        robot = machine(rng)
        if robot.nq == robot.nv and max(joint.nv for joint in robot.model.joints[1:]) == 1:
            return robot
    return wbc.robots.load(str(rng.choice(ARMS)))


def random_stack(robot: Robot, rng: np.random.Generator) -> Stack:
    """A hand, a posture and joint limits, and a random choice of what else an export in single precision can have."""
    frames = [frame.name for frame in robot.model.frames if frame.parentJoint > 0]
    stack = Stack(robot, float(rng.choice([0.001, 0.002, 0.005, 0.01])), calm=bool(rng.random() < 0.8))

    def some(probability: float = 0.3) -> bool:
        return bool(rng.random() < probability)

    def frame() -> str:
        return str(rng.choice(frames))

    stack.add(EndEffector(frames[-1], kind=str(rng.choice(["pose", "position"]))), name="hand")
    if some():
        kind = str(rng.choice(["pose", "position", "orientation"]))
        stack.add(EndEffector(frame(), kind=kind), name="other", weight=float(10.0 ** rng.uniform(-2.0, 1.0)))
    stack.add(Posture(), name="posture", weight=float(10.0 ** rng.uniform(-4.0, -1.0)))
    if some():
        stack.add(Damping(), name="damping", weight=float(10.0 ** rng.uniform(-4.0, -1.0)))
    stack.add(JointLimits(), name="limits")
    if some():
        stack.add(Hold(frame(), kind=str(rng.choice(["position", "orientation"]))), name="hold")
    if robot.shapes:
        for k in range(int(rng.integers(3))):
            stack.add(Obstacle(Sphere(float(rng.uniform(0.02, 0.3))), margin=0.01), name=f"ball{k}")
        if some():
            stack.add(Obstacle(HalfSpace()), name="floor")
    if some():
        stack.add(FrameVelocityLimit(frame(), linear=float(rng.uniform(0.05, 1.0))), name="speed")
    if some():
        stack.add(WorkspaceBox(frame(), lower=(-0.5, -0.5, -0.5), upper=(0.5, 0.5, 0.5)), name="box")
    return stack


@dataclass(frozen=True)
class Case:
    """A random stack's answers in both precisions."""

    label: str
    states: States
    single: Ticks

    @property
    def off(self) -> Array:
        """Largest difference of a command where the statuses agree [rad/s, m/s]."""
        off: Array = np.abs(self.single.v - self.states.v).max(axis=1)[self.single.status == self.states.status]
        return off

    @property
    def differ(self) -> int:
        """How many statuses differ."""
        return int((self.single.status != self.states.status).sum())


def random_cases(seeds: range, count: int, archive: str | None = None) -> Iterator[Case]:
    """Random stacks of random robots, ``count`` states each; those with odd seeds among contradictions."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        robot = random_robot(seed, rng)
        c = random_stack(robot, rng).compile()
        c.reset(robot.neutral)
        with TemporaryDirectory() as place:
            folder = c.export(Path(place) / "tick", solver_source=archive or True, states=1)
            build_here(folder, SINGLE, *UNOPTIMISED)
            near = States(vectors(c.clone(), count, seed), robot.nq, robot.nv) if seed % 2 == 0 else None
            states = near or in_closed_loop(c.clone(), count, seed)
            label = f"{robot.name}: {', '.join(entry.name for entry in c.stack.entries)}"
            yield Case(label, states, ticks_here(folder, states))


def main() -> int:
    """Print every case; the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stacks", type=int, default=18, help="How many stacks.")
    parser.add_argument("--first", type=int, default=0, help="Seed of the first one.")
    parser.add_argument("--states", type=int, default=300, help="States of each.")
    parser.add_argument("--archive", help="DAQP's source archive; default: from the package index.")
    given = parser.parse_args()
    bad = 0
    try:
        need("gcc", "make")
        for case in random_cases(range(given.first, given.first + given.stacks), given.states, given.archive):
            relaxed = int((case.states.status == STATUSES.index(wbc.Status.RELAXED)).sum())
            print(
                f"{case.label}: {len(case.states.rows)} states, {relaxed} relaxed, {case.differ} statuses differ, "
                f"commands by {np.median(case.off):.1e} in the median, {case.off.max():.1e} at most",
                flush=True,
            )
            bad += case.differ
    except (MissingProgramError, SolverSourceError) as error:
        print(f"not checked: {error}", file=sys.stderr)
        return MISSING
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
