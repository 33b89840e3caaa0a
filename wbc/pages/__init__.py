"""Pages of tasks and constraints: what the code declares is written into them, so that it cannot grow stale."""

from __future__ import annotations

from wbc.pages.folder import INDEX, page_name, shipped, stale, update

__all__ = ["INDEX", "page_name", "shipped", "stale", "update"]
