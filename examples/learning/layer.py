"""Targets are learned through the ticks: 32 hands are to move along x at 0.1 m/s, whatever their arms do."""

import numpy as np
import torch

import wbc
from wbc.learning import command_layer

N = 32
robot = wbc.robots.load("panda")
stack = wbc.Stack(robot, dt=0.02, calm=False).add(wbc.tasks.EndEffector("panda_hand_tcp", kind="position"), name="hand")
stack.add(wbc.tasks.Posture(), name="posture", weight=1e-2).add(wbc.tasks.JointLimits())
batch = stack.compile().batch(N)
layer = command_layer(batch, "hand.target")

rng = np.random.default_rng(0)
q = torch.tensor(np.array([robot.neutral + 0.1 * rng.normal(size=7) for _ in range(N)]))
jacobians = torch.tensor(np.array([robot.jacobian(one, "panda_hand_tcp")[:3] for one in q.numpy()]))
targets = torch.tensor(
    np.array([robot.pose(one, "panda_hand_tcp").translation for one in q.numpy()]), requires_grad=True
)
wanted, optimiser = torch.tensor([0.1, 0.0, 0.0], dtype=torch.float64), torch.optim.Adam([targets], lr=2e-3)
for _ in range(100):
    batch.reset()
    velocities = torch.einsum("nij,nj->ni", jacobians, layer(q, targets))
    loss = (velocities - wanted).square().sum(1).mean()
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
print(f"off by {1e3 * loss.sqrt().item():.2g} mm/s")
