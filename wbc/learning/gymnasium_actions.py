"""Actions of a policy as values of a stack, under Gymnasium."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import extras, validation
from wbc.batch.batch import Batch
from wbc.errors import RangeError
from wbc.validation import Array

if TYPE_CHECKING:
    import gymnasium


def stack_actions(
    env: gymnasium.vector.VectorEnv[Any, Any, Any],
    batch: Batch,
    space: gymnasium.Space[Any],
    aim: Callable[[Batch, Array, Array], None],
    configuration: Callable[[Any], Array],
    velocity: Callable[[Any], Array] | None = None,
) -> gymnasium.vector.VectorWrapper[Any, Any, Any, Any, Any]:
    """Environments whose actions are what a stack is told: it turns them into commands that keep its constraints.

    The ``info`` of a step has ``solved`` [n] and ``command`` [n, nv].

    Args:
        env: n environments whose actions are velocities of the joints [n, nv].
        batch: of n robots. space: of the actions of one environment, as a policy sees it.
        aim: ``(batch, actions, q)``: sets values of the batch.
        configuration: of observations: q [n, nq]. velocity: measured velocities [n, nv]; give it where the stack limits
            accelerations, as an environment that begins anew knows nothing of the last command.

    Raises:
        MissingPackageError: gymnasium is not installed. RangeError: another number of robots, or of actions, than
            the environments have. ShapeError: no batch. Those of :meth:`wbc.batch.Batch.step`.
    """
    extras.require("gymnasium", "actions under Gymnasium")
    import gymnasium

    validation.instance("batch", batch, Batch, "a wbc Batch")
    if env.num_envs != batch.count:
        raise RangeError("batch", batch.count, f"expected as many robots as environments, {env.num_envs}")

    class StackActions(gymnasium.vector.VectorWrapper[Any, Any, Any, Any, Any]):
        seen: Any = None
        single_action_space, action_space = space, gymnasium.vector.utils.batch_space(space, batch.count)

        def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Any:
            self.seen, info = self.env.reset(seed=seed, options=options)
            batch.reset(np.asarray(configuration(self.seen), dtype=np.float64))
            return self.seen, info

        def step(self, actions: Any) -> Any:
            if self.seen is None:
                raise RangeError("step", None, "the environments have no state yet: call reset first")
            if len(actions) != batch.count:
                raise RangeError("actions", len(actions), f"expected one for each of {batch.count} environments")
            q = np.asarray(configuration(self.seen), dtype=np.float64)
            aim(batch, np.asarray(actions, dtype=np.float64), q)
            step = batch.step(q, None if velocity is None else np.asarray(velocity(self.seen), dtype=np.float64))
            self.seen, *ended, info = self.env.step(step.v.astype(env.single_action_space.dtype))
            return self.seen, *ended, info | {"solved": step.solved, "command": step.v}

    return StackActions(env)
