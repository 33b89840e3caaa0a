"""Studies (floor 13): many trials of a scenario, over parameters and seeds, in this process or on a cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import extras, lazy

if TYPE_CHECKING:
    from wbc.study.carrying_out import Progress, carry_out
    from wbc.study.declaration import Study, StudyError
    from wbc.study.kept import Kept
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = ["Kept", "Progress", "Study", "StudyError", "carry_out"]

extras.require("studies", "a study")
