"""The memory and code of a tick, for what a stack was compiled to."""

from __future__ import annotations

from wbc.controller.native import NativeTick
from wbc.controller.tick import Assembly
from wbc.controller.vm import VmAssembly
from wbc.errors import SolverError
from wbc.stack.artifact import Artifact
from wbc.stack.declaration import Declaration


def assembly_of(stack: Declaration, artifact: Artifact) -> Assembly:
    """The native tick, or the virtual machine's.

    Raises:
        SolverError: the artifact has neither.
    """
    if artifact.library is not None:
        return NativeTick(artifact.library, artifact.layout)
    if artifact.program is not None:
        return VmAssembly(artifact.program, stack, artifact.layout)
    raise SolverError("artifact", artifact, "has neither a library nor a program")
