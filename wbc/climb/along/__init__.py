"""Walking along a way of the body that is given: the body goes on at its speed while limbs change their footholds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.climb.along.body_track import BodyTrack as BodyTrack
    from wbc.climb.along.planning import AlongOptions as AlongOptions, plan_along as plan_along
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
