"""Ticks of a batch as a layer of PyTorch."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import extras, validation
from wbc.batch.batch import Batch
from wbc.errors import RangeError
from wbc.validation import Array

if TYPE_CHECKING:
    import torch


def command_layer(batch: Batch, *values: str) -> torch.nn.Module:
    """A module that ticks a batch: configurations [n, nq] and values of items in, velocities [n, nv] out, gradients by
    all of these.

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
    names: list[tuple[str, str]] = [(item, value) for item, _, value in (str(name).rpartition(".") for name in values)]
    # Compiled now, and refused now
    batch.pullback.require(names)

    class TickFunction(torch.autograd.Function):  # type: ignore[misc]  # without torch installed it is Any
        @staticmethod
        def forward(ctx: Any, *given: torch.Tensor) -> torch.Tensor:
            q, *numbers = (np.ascontiguousarray(tensor.detach().cpu().double().numpy()) for tensor in given)
            told: dict[str, dict[str, Array]] = {item: {} for item, _ in names}
            for (item, value), array in zip(names, numbers, strict=True):
                told[item][value] = array
            batch.set(**told)
            ctx.step, ctx.given = batch.step(q), [(tensor.shape, tensor.dtype, tensor.device) for tensor in given]
            ctx.step.keep()
            module.solved = torch.from_numpy(ctx.step.solved.copy())
            return torch.from_numpy(ctx.step.v.copy()).to(given[0])

        @staticmethod
        @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
        def backward(ctx: Any, weights: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
            pulled, out = ctx.step.pull(weights.detach().cpu().double().numpy()), list[torch.Tensor | None]()
            each = zip(ctx.needs_input_grad, [("q", None), *names], ctx.given, strict=True)
            for asked, place, (shape, kind, device) in each:
                numbers = torch.from_numpy(_shaped(pulled.by(*place), shape)).to(device, kind) if asked else None
                # One value for all robots moves with all of them
                out.append(numbers if numbers is None or numbers.shape == shape else numbers.sum(0))
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


def _shaped(numbers: Array, shape: Any) -> Array:
    """Gradients [n, ...] in the shape of a value: of poses and rotations by columns, as matrices."""
    if tuple(shape[-2:]) not in ((4, 4), (3, 3)) or numbers.shape[1] not in (9, 12):
        return numbers
    out, columns = np.zeros((len(numbers), *shape[-2:])), numbers.reshape(len(numbers), -1, 3).transpose(0, 2, 1)
    out[:, :3, : columns.shape[2]] = columns
    return out
