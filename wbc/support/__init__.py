"""What contacts and motors can hold at rest: what is lacking, and over which region the centre of mass may be."""

from __future__ import annotations

from wbc.support.region import Region, region
from wbc.support.statics import Lacking, lacking

__all__ = ["Lacking", "Region", "lacking", "region"]
