"""What contacts and motors can hold at rest: what is lacking, over which region the centre of mass may be, and
braking.
"""

from __future__ import annotations

from wbc.support.braking import Braking, braking
from wbc.support.region import Region, region
from wbc.support.statics import Lacking, lacking

__all__ = ["Braking", "Lacking", "Region", "braking", "lacking", "region"]
