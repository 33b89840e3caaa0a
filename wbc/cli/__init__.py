"""The command line ``wbc``."""

from __future__ import annotations


def main() -> None:
    """Entry point of the command ``wbc``."""
    # Imported here, so that importing the package for its documentation costs nothing
    from wbc.cli.app import app
    from wbc.interrupts import obey_kill

    obey_kill()
    app()
