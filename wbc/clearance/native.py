"""Sweeps in C: one call for all pairs over a whole motion."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wbc.clearance.motion import Motion
from wbc.clearance.scene import SweptScene
from wbc.geometry.kernel import HEADERS, ShapeTable, checked
from wbc.native.kernel import kernel
from wbc.native.library import load_library
from wbc.native.structures import CStructures
from wbc.symbolic.joint_steps import place
from wbc.validation import Array

#: The C of a sweep, which the planner includes
SOURCES = Path(__file__).parent / "native"
#: How often a motion is halved at most, in ``native/sweep.c`` and to its knots
HALVINGS = 128


#: ``sweep_t`` of ``native/sweep.h``
_SweepStruct = CStructures(SOURCES / "sweep.h").structure("sweep_t")


@functools.cache
def library() -> ctypes.PyDLL:
    """The compiled code.

    Raises:
        CompileError: as of :func:`wbc.geometry.kernel.library`.
    """
    found = checked(load_library(kernel(SOURCES / "sweep.c", HEADERS)), wbc_sweep_size=_SweepStruct)
    found.wbc_sweep.argtypes = [ctypes.c_void_p, ctypes.c_int]
    found.wbc_sweep_at.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_double, ctypes.c_void_p]
    return found


class NativeSweep:
    """A scene in memory.

    Attributes:
        low, high, when: of every pair at the last sweep: the proven least of what counts, the least that was found, and
            when [knots].
    """

    def __init__(self, scene: SweptScene) -> None:
        self.scene, self._functions = scene, library()
        bodies, pairs, frames = len(scene.bodies), len(scene.pairs), len(scene.tree.frames)
        depth = max([1, *(len(chain) for chain in scene.chain)])
        chain = np.full((bodies, depth), -1)
        for k, links in enumerate(scene.chain):
            chain[k, : len(links)] = links
        self.low, self.high, self.when = (np.zeros(pairs) for _ in range(3))
        self._chosen = np.zeros(pairs, dtype=np.int32)
        tree = scene.tree.frames
        axes = [[*frame.axis, frame.scale, frame.offset] for frame in tree]
        self._arrays: dict[str, Array] = {}
        self._table = ShapeTable([body.shape for body in scene.bodies])
        self._hold(
            parent=[f.parent for f in tree], kind=[int(f.moves) for f in tree],
            coordinate=[f.coordinate for f in tree], place=scene.tree.places, axis=np.array(axes).reshape(-1, 5),
            pose=np.zeros((frames, 12)), deviation=np.zeros((frames, 4)), drift=np.zeros((frames, 7)),
            body_frame=scene.frame, body_place=np.array([place(pose) for pose in scene.place]).reshape(-1, 12),
            body_pose=np.zeros((bodies, 12)), line=scene.line, world_line=np.zeros((bodies, 6)), chain=chain,
            chain_length=[len(links) for links in scene.chain], moved=np.zeros((bodies, depth + 1, 2)),
            stamp=np.zeros(bodies, dtype=np.int32), first=scene.first, second=scene.second,
            stop_first=scene.stops[:, 0], stop_second=scene.stops[:, 1], required=scene.required,
            list=np.zeros(HALVINGS * max(pairs, 1), dtype=np.int32), low=self.low, high=self.high, when=self.when,
            chosen=self._chosen,
        )  # fmt: skip
        self._sweep = _SweepStruct(
            frames=frames, bodies=bodies, pairs=pairs, depth=depth, scalars=len(scene.tree.coordinates),
            frees=len(scene.tree.free), shape=self._table.address,
            **{name: array.ctypes.data for name, array in self._arrays.items()},
        )  # fmt: skip
        self._at = ctypes.c_void_p(ctypes.addressof(self._sweep))
        self._motion: Motion | None = None

    @property
    def measured(self) -> tuple[int, int]:
        """Exact distances and pieces of the motion of the last sweep."""
        return int(self._sweep.measured), int(self._sweep.nodes)

    def sweep(
        self, motion: Motion, chosen: NDArray[np.intp], exempt: Sequence[Any], aim: int, tolerance: float, far: float
    ) -> int | None:
        """Fill ``low``, ``high`` and ``when`` of the ``chosen`` pairs; the pair at which it stopped, None: at none."""
        self._take(motion, exempt)
        it = self._sweep
        it.aim, it.tolerance, it.far = aim, tolerance, far
        self._chosen[: len(chosen)] = chosen
        self.low[chosen], self.high[chosen], self.when[chosen] = np.inf, np.inf, 0.0
        self._functions.wbc_sweep(self._at, len(chosen))
        return None if it.stopped < 0 else int(it.stopped)

    def require(self, required: Array) -> None:
        """Other distances that the pairs keep [m], [pairs]."""
        self._arrays["required"][:] = required

    @property
    def address(self) -> int:
        """Of the structure."""
        return ctypes.addressof(self._sweep)

    def at(self, pair: int, knots: float) -> Array:
        """Distance, nearest points and what counts of a pair of the last motion, [8]."""
        out = np.zeros(8)
        self._functions.wbc_sweep_at(self._at, pair, knots, out.ctypes.data)
        return out

    def _hold(self, **arrays: Any) -> None:
        """Keep arrays as the code wants them; what it fills is contiguous already, and stays the same."""
        integers = ("parent", "kind", "coordinate", "chain", "chain_length", "stop_first", "stop_second")
        for name, array in arrays.items():
            kind = np.int32 if name in integers or (name.startswith("exempt_") and name != "exempt_point") else None
            kept = np.ascontiguousarray(array, dtype=kind)
            self._arrays[name] = kept if kept.dtype == np.int32 else np.ascontiguousarray(kept, dtype=np.float64)

    def _take(self, motion: Motion, exempt: Sequence[Any]) -> None:
        start = np.searchsorted([entry[0] for entry in exempt], np.arange(len(self.scene.pairs) + 1))
        new: dict[str, Any] = {
            "exempt_start": start, "exempt_from": [e[1] for e in exempt], "exempt_to": [e[2] for e in exempt],
            "exempt_side": [e[3] for e in exempt], "exempt_point": np.array([e[4] for e in exempt]).reshape(-1, 8),
        }  # fmt: skip
        if motion is not self._motion:
            new |= {
                "control": motion.controls, "variation": motion.variation, "rate": motion.rates, "slack": motion.slack,
                "free_pose": motion.poses, "free_turn": motion.turns, "free_variation": motion.free_variation,
                "free_slack": motion.free_slack,
            }  # fmt: skip
            self._motion = motion
            self._sweep.knots, self._sweep.degree = len(motion.times), motion.degree
        self._hold(**new)
        for name in new:
            setattr(self._sweep, name, self._arrays[name].ctypes.data)
