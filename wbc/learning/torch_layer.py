"""Ticks of a batch as a layer of PyTorch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import extras, validation
from wbc.batch.batch import Batch
from wbc.batch.batch_step import BatchStep, Pulled
from wbc.errors import RangeError
from wbc.validation import Array

if TYPE_CHECKING:
    import torch


def command_layer(batch: Batch, *values: str) -> torch.nn.Module:
    """A module that ticks a batch: configurations and values of items in, velocities out, gradients by all of these.

        layer = wbc.learning.command_layer(controller.batch(4096), "hand.target")
        v = layer(q, poses)                                 # [n, nq], [n, 4, 4] -> [n, nv]
        v.square().sum().backward()

    Gradients are those of :meth:`wbc.batch.BatchStep.pull`: by the numbers as they are, of poses by their matrices.
    Robots whose rows do not all hold have none; ``layer.solved`` says which do.

    Args:
        batch: of a stack with one level, without soft rows and measured distances, ``calm=False``, whose commands are
            velocities. values: ``ITEM.VALUE``, in the order in which the module takes them.

    Raises:
        MissingPackageError: PyTorch is not installed. SolverError: a stack of another kind.
        UnknownNameError: no such item or value.
    """
    extras.require("torch", "a layer of PyTorch")
    import torch

    validation.instance("batch", batch, Batch, "a wbc Batch")
    # Compiled now, and refused now
    batch.pullback.require(names := [split(name) for name in values])

    class TickFunction(torch.autograd.Function):  # type: ignore[misc]  # without torch installed it is Any
        @staticmethod
        def forward(ctx: Any, q: torch.Tensor, *given: torch.Tensor) -> torch.Tensor:
            step = _ticked(batch, names, *(tensor.detach().cpu().double().numpy() for tensor in (q, *given)))
            ctx.step, ctx.like = step, [(tensor.shape, tensor.dtype, tensor.device) for tensor in (q, *given)]
            module.solved = torch.from_numpy(step.solved.copy())
            return torch.from_numpy(step.v.copy()).to(q)

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, weights: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
            pulled = ctx.step.pull(weights.detach().cpu().double().numpy())
            out: list[torch.Tensor | None] = []
            for asked, place, (shape, kind, device) in zip(
                ctx.needs_input_grad, [("q", None), *names], ctx.like, strict=True
            ):
                if not asked:
                    out.append(None)
                    continue
                found = torch.from_numpy(_shaped(pulled, *place, shape)).to(kind).to(device)
                # One value for all robots moves with all of them
                out.append(found if found.shape == shape else found.sum(0))
            return tuple(out)

    class CommandLayer(torch.nn.Module):  # type: ignore[misc]  # the same
        solved = torch.zeros(0, dtype=torch.bool)

        def forward(self, q: torch.Tensor, *given: torch.Tensor) -> torch.Tensor:
            if len(given) != len(names):
                raise RangeError("values", len(given), f"expected {len(names)}: {', '.join(values)}")
            out: torch.Tensor = TickFunction.apply(q, *given)
            return out

    module = CommandLayer()
    return module


def split(name: str) -> tuple[str, str]:
    """Item and value of ``ITEM.VALUE``."""
    item, _, value = str(name).rpartition(".")
    return item, value


def _ticked(batch: Batch, names: list[tuple[str, str]], q: Array, *given: Array) -> BatchStep:
    values: dict[str, dict[str, Array]] = {}
    for (item, value), numbers in zip(names, given, strict=True):
        values.setdefault(item, {})[value] = np.ascontiguousarray(numbers)
    batch.set(**values)
    step = batch.step(np.ascontiguousarray(q))
    step.keep()
    return step


def _shaped(pulled: Pulled, name: str, value: str | None, shape: Any) -> Array:
    """Gradients [n, ...] in the shape of a value."""
    numbers = pulled.by(name, value)
    rows = len(numbers)
    if tuple(shape[-2:]) not in ((4, 4), (3, 3)) or numbers.shape[1] not in (9, 12):
        return numbers
    out = np.zeros((rows, *shape[-2:]))
    out[:, :3, :3] = numbers[:, :9].reshape(rows, 3, 3).transpose(0, 2, 1)
    if numbers.shape[1] == 12:
        out[:, :3, 3] = numbers[:, 9:]
    return out
