"""Studies (floor 13): many trials of a scenario, over parameters and seeds, in this process or on a cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import extras, lazy

if TYPE_CHECKING:
    from wbc.study.carrying_out import Progress as Progress, carry_out as carry_out
    from wbc.study.declaration import Study as Study, StudyError as StudyError
    from wbc.study.kept import Kept as Kept
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)


extras.require("studies", "a study")
