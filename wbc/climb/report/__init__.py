"""What a climb leaves behind: log, check, figures, plots, pictures, a film and a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.climb.report.figures import climb_figures as climb_figures
    from wbc.climb.report.folder import FIGURES as FIGURES, WRITTEN as WRITTEN, write as write
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
