"""A task and a constraint of one's own, with pink: classes with an error, a barrier and their Jacobians."""

import sys

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import Barrier
from pink.tasks import Task

DT = 0.005


class Look(Task):
    """The flange looks at a point: two components of its direction in the flange's frame vanish."""

    def __init__(self, cost: float, gain: float) -> None:
        super().__init__(cost=cost, gain=gain)
        self.point = np.zeros(3)

    def compute_error(self, configuration: pink.Configuration) -> np.ndarray:
        return configuration.get_transform_frame_to_world("panda_link8").actInv(self.point)[:2]

    def compute_jacobian(self, configuration: pink.Configuration) -> np.ndarray:
        seen = configuration.get_transform_frame_to_world("panda_link8").actInv(self.point)
        jacobian = configuration.get_frame_jacobian("panda_link8")
        return (pin.skew(seen) @ jacobian[3:] - jacobian[:3])[:2]

    def __repr__(self) -> str:
        return f"Look({self.point})"


class Height(Barrier):
    """The elbow stays at least so high."""

    def __init__(self, lower: float, gain: float) -> None:
        super().__init__(dim=1, gain=gain)
        self.lower = lower

    def compute_barrier(self, configuration: pink.Configuration) -> np.ndarray:
        return configuration.get_transform_frame_to_world("panda_link4").translation[2:] - self.lower

    def compute_jacobian(self, configuration: pink.Configuration) -> np.ndarray:
        turn = configuration.get_transform_frame_to_world("panda_link4").rotation
        return (turn @ configuration.get_frame_jacobian("panda_link4")[:3])[2:]


model = pin.buildModelFromUrdf(sys.argv[1])
q = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
configuration = pink.Configuration(model, model.createData(), q)
look, height = Look(cost=1.0, gain=DT), Height(lower=0.55, gain=1.0)
posture = pink.tasks.PostureTask(cost=0.03, gain=DT)
posture.set_target_from_configuration(configuration)

lowest = 1.0
for place in ([0.6, 0.3, 0.2], [0.3, -0.5, 0.4]):
    look.point = np.array(place)
    for _ in range(600):
        v = pink.solve_ik(configuration, [look, posture], DT, solver="daqp", barriers=[height])
        configuration.integrate_inplace(v, DT)
        lowest = min(lowest, configuration.get_transform_frame_to_world("panda_link4").translation[2])
    error = np.linalg.norm(look.compute_error(configuration))
    print(f"look {1e3 * error:.2f} mm past the point, elbow at least {lowest:.4f} m high")
    if error > 0.05 or lowest < 0.549:
        raise SystemExit("the flange looks elsewhere, or the elbow sank")
