"""``wbc coordinates analyse``: rank analysis of published coordinate sets, or of locks and points of any robot."""

from __future__ import annotations

from dataclasses import dataclass

from wbc.cli.coordinates.asked import AnalysisAsked


@dataclass(frozen=True)
class Analyse(AnalysisAsked):
    """Say where coordinates lose rank, and whether they suffice.

    The published arms have sets by name; spdm_on_ssrms, and spdm with --tree, have sets of all their joints, decided by
    blocks. --lock, --point and --plane make a set for any robot.
    """

    def run(self) -> None:
        from wbc.cli.coordinates.loci import analysed

        analysed(self)
