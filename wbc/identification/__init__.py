"""Inertias from motion and torques: what a motion shows, motions that show much, and fits that are bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.identification.base_parameters import BaseParameters, base_parameters, identifiable
    from wbc.identification.exciting import ExcitingMotion, exciting_motion
    from wbc.identification.fit import Identified, identify
    from wbc.identification.information import Information
    from wbc.identification.regression import Regression, Samples
else:
    __getattr__ = lazy.attach(__name__, __file__)

__all__ = [
    "BaseParameters",
    "ExcitingMotion",
    "Identified",
    "Information",
    "Regression",
    "Samples",
    "base_parameters",
    "exciting_motion",
    "identifiable",
    "identify",
]


def __dir__() -> list[str]:
    return __all__
