"""Whether a command lets pairs without a row close faster than their rows would: then they need one.

A row allows a pair, whose distance less the margin is h, to close at ``rate`` h, and no faster than its joints brake in
front of the margin (docs/reach.md). A pair without a row is checked at the command v, first by a bound on the speed of
all points of both bodies, and where that does not do, by the row itself (``native/missing.h``). What closes faster
than its row allows is urgent: it has a row in the next choice, before any other, and so have those with rows that push.
"""

from __future__ import annotations

from typing import Final

#: How much of what its row allows a pair closes by: up to half of it; up to 0.999 of it, or the pair is
#: within its margin; all of it; more than it, of which in the first case the pair is within its margin and opens too
#: slowly
LITTLE: Final = 0
HALF: Final = 1
ALL: Final = 2
TOO_MUCH: Final = 3
INWARD: Final = 4
