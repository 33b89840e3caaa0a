"""A policy moves hands, 64 arms at a time: the stack turns what it asks for into commands within all limits."""

import numpy as np
from gymnasium import spaces, vector

import wbc
from wbc.learning import stack_actions

N, DT, ROOM = 64, 0.02, spaces.Box(-9.0, 9.0, (7,))  # environments, s
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=DT).add(wbc.tasks.EndEffector("panda_hand_tcp", kind="position"), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3).add(wbc.tasks.JointLimits())
batch, home = stack.compile().batch(N), robot.pose(robot.neutral, "panda_hand_tcp").translation


class Arms(vector.VectorEnv):
    """Arms that do what they are told."""

    num_envs, single_action_space, single_observation_space, q = N, ROOM, ROOM, np.tile(robot.neutral, (N, 1))

    def reset(self, **options):
        return self.q, {}

    def step(self, v):
        self.q = self.q + DT * v
        return self.q, -np.square(v).sum(1), np.zeros(N, bool), np.zeros(N, bool), {}


env = stack_actions(Arms(), batch, spaces.Box(-0.2, 0.2, (3,)), lambda b, a, q: b.set(hand=home + a), lambda q: q)
print("reward", env.reset() and np.mean([env.step(env.action_space.sample())[1].mean() for _ in range(50)]))
