"""Batches and controllers under PyTorch, Gymnasium and LeRobot's interface."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box

import wbc
from tests.refusals import assert_refused
from wbc.errors import RangeError, UnknownNameError
from wbc.formats import RecordedMotion
from wbc.learning import StackRobot, StackTeleoperator, command_layer, stack_actions

EXAMPLES = Path(__file__).parents[2] / "examples" / "learning"


class Arms(gymnasium.vector.VectorEnv[Any, Any, Any]):
    """Arms that do what they are told; an episode is 50 steps long."""

    def __init__(self, robot: Any, count: int, dt: float) -> None:
        self.num_envs, self.robot, self.dt = count, robot, dt
        self.single_action_space = Box(-10.0, 10.0, (robot.nv,), np.float64)
        self.single_observation_space = Box(-10.0, 10.0, (robot.nq,), np.float64)
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, count)
        self.observation_space = gymnasium.vector.utils.batch_space(self.single_observation_space, count)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
        self.q = np.tile(self.robot.neutral, (self.num_envs, 1))
        return self.q.copy(), {}

    def step(self, actions: Any) -> Any:
        self.q = self.q + self.dt * actions
        none = np.zeros(self.num_envs, dtype=bool)
        return self.q.copy(), -np.abs(actions).sum(1), none, none, {}


def test_actions_are_what_the_stack_is_told() -> None:
    robot, n = wbc.robots.load("panda"), 6
    stack = wbc.Stack(robot, dt=0.02).add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3).add(wbc.tasks.JointLimits())
    batch, start = stack.compile(backend="vm").batch(n), robot.pose(robot.neutral, "panda_hand_tcp")

    def aim(robots: Any, actions: np.ndarray, q: np.ndarray) -> None:
        poses = np.tile(start.homogeneous, (n, 1, 1))
        poses[:, :3, 3] += actions
        robots.set(hand=poses)

    inner = Arms(robot, n, 0.02)
    env = stack_actions(inner, batch, Box(-0.1, 0.1, (3,)), aim, lambda seen: seen)
    assert env.action_space.shape == (n, 3)
    assert_refused(lambda: env.step(np.zeros((n, 3))), RangeError, "call reset")
    env.reset(seed=1)
    moves = env.action_space.sample()
    for _ in range(150):
        q, _, _, _, info = env.step(moves)
        assert info["solved"].all()
    reached = np.array([robot.pose(one, "panda_hand_tcp").translation - start.translation for one in q])
    # The posture pulls a little
    assert np.allclose(reached, moves, atol=3e-3)
    assert ((q >= robot.limits.position_lower) & (q <= robot.limits.position_upper)).all()
    assert_refused(lambda: env.step(np.zeros((n - 1, 3))), RangeError, "actions")
    few = Arms(robot, n - 1, 0.02)
    assert_refused(lambda: stack_actions(few, batch, Box(-1, 1, (3,)), aim, lambda seen: seen), RangeError, "batch")


@pytest.mark.compiled
def test_gradcheck_passes() -> None:
    import torch

    robot, n = wbc.robots.load("panda"), 4
    stack = wbc.Stack(robot, dt=0.02, calm=False).add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-2).add(wbc.tasks.JointLimits())
    batch = stack.compile(backend="native").batch(n)
    layer = command_layer(batch, "hand.target", "posture.target")
    rng = np.random.default_rng(0)
    base = torch.tensor(robot.pose(robot.neutral, "panda_hand_tcp").homogeneous)

    def command(q: Any, twist: Any, posture: Any) -> Any:
        zero = torch.zeros(n, 4, 4, dtype=torch.float64)
        rows = [(1, 2, 3), (2, 0, 4), (0, 1, 5)]
        for (i, j, k), sign in ((row, s) for row in rows for s in (1.0, -1.0)):
            unit = torch.zeros(4, 4, dtype=torch.float64)
            unit[(j, i) if sign > 0 else (i, j)] = sign
            zero = zero + twist[:, k, None, None] * unit
        for k in range(3):
            unit = torch.zeros(4, 4, dtype=torch.float64)
            unit[k, 3] = 1.0
            zero = zero + twist[:, k, None, None] * unit
        batch.reset()
        return layer(q, base @ torch.matrix_exp(zero), posture)

    q = torch.tensor(np.array([0.7 * robot.neutral + 0.3 * robot.random(rng) for _ in range(n)]), requires_grad=True)
    twist = torch.tensor(0.2 * rng.normal(size=(n, 6)), requires_grad=True)
    posture = torch.tensor(np.tile(robot.neutral, (n, 1)), requires_grad=True)
    assert torch.autograd.gradcheck(command, (q, twist, posture), eps=1e-6, atol=1e-5, rtol=1e-4)
    assert layer.solved.all()
    # One value for all, in single precision
    wide = q.detach().float().requires_grad_()
    one = posture[0].detach().float().requires_grad_()
    layer(wide, base.float(), one).sum().backward()
    assert one.grad.shape == (7,)
    assert wide.grad.dtype == torch.float32
    assert_refused(lambda: command_layer(batch, "hand.targt"), UnknownNameError, "target")
    assert_refused(lambda: layer(q), RangeError, "values")


def test_lerobot_s_methods_lead_a_robot() -> None:
    robot = wbc.robots.load("panda")
    stack = wbc.Stack(robot, dt=0.02).add(wbc.tasks.Posture(), name="posture").add(wbc.tasks.JointLimits())
    follower = StackRobot(stack.compile(backend="vm"), "posture")
    assert_refused(follower.get_observation, RangeError, "connect")
    t = np.array([0.0, 1.0])
    motion = RecordedMotion(("panda_joint1",), t, np.array([[0.0], [9.0]]), None, {})
    now = [0.0]
    leader = StackTeleoperator(motion, clock=lambda: now[0])
    assert_refused(leader.get_action, RangeError, "connect")
    follower.connect()
    leader.connect()
    assert leader.action_features.keys() <= follower.action_features.keys() == follower.get_observation().keys()
    for k in range(200):
        now[0] = k / 100
        done = follower.send_action(leader.get_action())
    # 9 rad is beyond the joint's limit, which the stack keeps
    assert np.isclose(done["panda_joint1.pos"], robot.limits.position_upper[0], atol=2e-2)
    assert done["panda_joint1.pos"] <= robot.limits.position_upper[0]
    assert_refused(lambda: follower.send_action({"panda_joint9.pos": 0.0}), UnknownNameError, "panda_joint1.pos")
    follower.disconnect()
    assert not follower.is_connected


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["actions", "layer", "robot"])
def test_examples_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = (EXAMPLES / f"{name}.py").read_text()
    assert len(text.splitlines()) <= 30
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert capsys.readouterr().out
