"""``wbc docs``: the pages of tasks and constraints and the types of their values, from their declarations."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from wbc.errors import WbcError


class DocsError(WbcError):
    """There are no pages: they are part of the repository, not of the installed package."""


@dataclass(frozen=True)
class Docs:
    """Write pages from what the code declares (in a clone).

    The pages of tasks and constraints, and the types of their values.
    """

    check: Annotated[bool, "Write nothing; exit code 1 where a page is stale."] = False
    folder: Annotated[Path, "Where the pages are. Default: those of the clone."] = (
        Path(__file__).resolve().parents[2] / "docs" / "tasks"
    )

    def run(self) -> int:
        from wbc import pages
        from wbc.cli.console import say
        from wbc.pages import stub

        if not self.folder.is_dir():
            raise DocsError("folder", str(self.folder), "no such folder; run it from a clone of the repository")
        check = self.check
        names = pages.stale(self.folder) + stub.stale() if check else pages.update(self.folder) + stub.update()
        for name in names:
            say(f"{'stale' if check else 'written'}: {name}")
        return int(check and bool(names))
