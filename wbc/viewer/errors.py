"""What can be wrong with a viewer."""

from __future__ import annotations

from wbc.errors import WbcError


class ViewerError(WbcError):
    """A viewer that cannot be shown: what it needs is not installed, or its process ended."""
