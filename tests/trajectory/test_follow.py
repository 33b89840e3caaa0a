"""Joint paths that follow poses with a user's stack; Pinocchio judges where the frame is."""

from __future__ import annotations

from functools import cache
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.models import free_direction, placement
from wbc.errors import ContinuityError, InfeasibleError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, JointLimits, Obstacle, Posture
from wbc.trajectory import follow, following, geodesic_path
from wbc.trajectory.paths.path import Path, PolynomialPath

TIP = "panda_hand_tcp"
ROBOT = wbc.robots.load("panda")


class Circle(Path):
    """A circle in the plane of y and z through a pose, or a piece of one; the orientation stays."""

    space, dof, degree = "poses", 6, None

    def __init__(self, home: pin.SE3, radius: float, turns: float = 1.0) -> None:
        self.home, self.radius = home, radius
        self.knots = np.array([0.0, 2.0 * np.pi * radius * turns])

    def evaluate(self, s: np.ndarray, order: int = 0, piece: Any = None) -> np.ndarray:
        assert order == 0
        out = np.tile(self.home.homogeneous, (len(s), 1, 1))
        out[:, 1, 3] += self.radius * np.sin(s / self.radius)
        out[:, 2, 3] += self.radius * (1.0 - np.cos(s / self.radius))
        return out


def line(home: pin.SE3, move: np.ndarray) -> Path:
    """A straight line from a pose; the orientation stays."""
    return geodesic_path(home, pin.SE3(home.rotation, home.translation + move))


def tip(q: np.ndarray) -> pin.SE3:
    return pin.SE3(placement(ROBOT, TIP, q))


@cache
def stack(kind: str = "plain") -> wbc.Stack:
    out = wbc.Stack(ROBOT, dt=0.01)
    out.add(EndEffector(TIP), name="hand").add(Posture(), name="posture", weight=1e-3).add(JointLimits())
    if kind == "ball":
        out.add(Obstacle(Sphere(0.08), margin=0.01, pose=pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.7]))), name="ball")
    return out


def off(path: PolynomialPath, poses: Path, count: int = 400) -> float:
    """Largest distance of the frame from the poses [m]."""
    s = np.linspace(poses.knots[0], poses.knots[-1], count)
    places = np.array([tip(q).translation for q in path.evaluate(s)])
    return float(np.linalg.norm(places - poses.evaluate(s)[:, :3, 3], axis=1).max())


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_the_frame_is_on_the_path(tolerance: float) -> None:
    poses = Circle(tip(ROBOT.neutral), 0.12)
    followed = follow(stack(), poses, ROBOT.neutral, "hand", tolerance)
    assert off(followed.path, poses) < 1.2 * tolerance
    assert followed.error[0] <= tolerance
    assert (followed.path.knots[[0, -1]] == poses.knots).all()


def test_what_the_pose_leaves_open_is_the_stack_s() -> None:
    """The same configurations come back at the end of a circle, those of the smallest distance to the posture."""
    poses = Circle(tip(ROBOT.neutral), 0.12)
    followed = follow(stack(), poses, ROBOT.neutral, "hand")
    ends = followed.path.evaluate(followed.path.knots[[0, -1]])
    assert np.abs(ends - ROBOT.neutral).max() < 1e-7
    q = followed.path.evaluate(np.array([0.3]))[0]
    free = free_direction(ROBOT, TIP, q)
    assert np.abs(q - ROBOT.neutral).max() > 0.1
    assert abs(free @ (q - ROBOT.neutral)) < 1e-4


def test_other_tasks_and_obstacles_take_part() -> None:
    poses = Circle(tip(ROBOT.neutral), 0.12)
    paths = {kind: follow(stack(kind), poses, ROBOT.neutral, "hand") for kind in ("plain", "ball")}
    s = np.linspace(0.0, poses.knots[-1], 60)
    apart = np.abs(paths["ball"].path.evaluate(s) - paths["plain"].path.evaluate(s)).max()
    assert apart > 0.05
    assert off(paths["ball"].path, poses) < 2e-5
    controller = stack("ball").compile(backend="vm")
    least = {}
    for kind, followed in paths.items():
        controller.reset(ROBOT.neutral)
        least[kind] = min(controller.step(q, np.zeros(7)).margins["ball"].min() for q in followed.path.evaluate(s))
    assert least["plain"] < -0.01
    assert least["ball"] > -1e-3


def test_position_limits_are_kept() -> None:
    """A joint whose range ends on the way stays within it, and the others make up for it."""
    poses = Circle(tip(ROBOT.neutral), 0.12)
    free = follow(stack(), poses, ROBOT.neutral, "hand").path.evaluate(np.linspace(0.0, poses.knots[-1], 200))
    upper = ROBOT.limits.position_upper.copy()
    upper[2] = 0.6 * free[:, 2].max()
    bounded = wbc.Stack(ROBOT.with_limits(position_upper=upper), dt=0.01)
    bounded.add(EndEffector(TIP), name="hand").add(Posture(), name="posture", weight=1e-3).add(JointLimits())
    followed = follow(bounded, poses, ROBOT.neutral, "hand", 1e-4)
    assert followed.path.coefficients[-1][:, 2].max() <= upper[2] + 1e-9
    assert off(followed.path, poses) < 2e-4


def test_a_path_out_of_reach_names_the_place() -> None:
    home = tip(ROBOT.neutral)
    move = np.array([0.8, 0.0, 0.0])
    with pytest.raises(InfeasibleError, match="not reached") as caught:
        follow(stack(), line(home, move), ROBOT.neutral, "hand")
    reach = caught.value.value
    assert 0.05 < reach < 0.6
    shorter = line(home, move * (reach - 1e-3) / 0.8)
    assert off(follow(stack(), shorter, ROBOT.neutral, "hand").path, shorter) < 2e-5


def test_a_jump_names_the_place_and_the_joint() -> None:
    """Random lines: where the branch ends, the configurations before it are still followed."""
    rng, found = np.random.default_rng(0), []
    for k in range(7):
        q = ROBOT.neutral + rng.uniform(-0.8, 0.8, 7)
        q = np.clip(q, ROBOT.limits.position_lower + 0.1, ROBOT.limits.position_upper - 0.1)
        home, move = tip(q), rng.uniform(-0.4, 0.4, 3)
        if k < 6:
            continue
        with pytest.raises(ContinuityError, match=r"panda_joint\d jumps by 0\.\d+") as caught:
            follow(stack(), line(home, move), q, "hand")
        found.append(caught.value.value)
        length = np.linalg.norm(move)
        before = line(home, move * (found[0] - 1e-3) / length)
        assert off(follow(stack(), before, q, "hand").path, before) < 2e-5
    assert found


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"task": "hnad"}, UnknownNameError, "hand"),
        ({"task": "posture"}, UnknownNameError, "hand"),
        ({"poses": PolynomialPath([0.0, 1.0], np.zeros((2, 1, 7)))}, ShapeError, "poses"),
        ({"start": np.zeros(6)}, ShapeError, "start"),
        ({"tolerance": 0.0}, RangeError, "tolerance"),
        ({"tolerance": 1e-13}, WbcError, "poses|tolerance"),
    ],
)
def test_bad_input(change: dict[str, Any], error: type[WbcError], text: str) -> None:
    good = {"stack": stack(), "poses": Circle(tip(ROBOT.neutral), 0.1), "start": ROBOT.neutral, "task": "hand"}
    with pytest.raises(error, match=text):
        follow(**{**good, **change})


def test_a_floating_base_is_refused() -> None:
    floating = wbc.Stack(wbc.robots.load("talos"), dt=0.01)
    floating.add(EndEffector("gripper_left_base_link"), name="hand")
    with pytest.raises(ShapeError, match="several coordinates"):
        follow(floating, Circle(pin.SE3.Identity(), 0.1), np.zeros(7), "hand")


def test_so_many_samples_are_made_and_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """33 of them, twice as many as often as every middle is off, and 4000 at most."""

    class Off:
        made: ClassVar[list[float]] = []

        def __init__(self, *given: Any) -> None:
            pass

        def begin(self, start: np.ndarray) -> tuple[Off, np.ndarray]:
            return self, start

        def at(self, s: float, q: np.ndarray) -> np.ndarray:
            self.made.append(s)
            return q

        def go(self, before: float, s: float, q: np.ndarray) -> np.ndarray:
            return self.at(s, q)

        def errors(self, path: Path, middle: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
            return np.ones(len(middle), bool), (1.0, 1.0)

    monkeypatch.setattr(following, "_Seeker", Off)
    with pytest.raises(RangeError, match="needs more than 4000 samples"):
        follow(stack(), line(tip(ROBOT.neutral), np.array([0.1, 0.0, 0.0])), ROBOT.neutral, "hand")
    assert len(Off.made) == 2049
