"""Inertias from motion and torques: what a motion shows, motions that show much, and fits that are bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.identification.exciting import ExcitingMotion as ExcitingMotion, exciting_motion as exciting_motion
    from wbc.identification.fit import Identified as Identified, identify as identify
    from wbc.identification.information import Information as Information
    from wbc.identification.parameter_base import (
        BaseParameters as BaseParameters,
        base_parameters as base_parameters,
        identifiable as identifiable,
    )
    from wbc.identification.regression import Regression as Regression, Samples as Samples
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
