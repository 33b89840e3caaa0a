"""The command line ``wbc``."""

from __future__ import annotations

#: Exit code where Ctrl-C came before any command
INTERRUPTED_EARLY = 130


def main() -> None:
    """Entry point of the command ``wbc``."""
    try:
        # Imported here, so that importing the package for its documentation costs nothing
        from wbc.interrupts import obey_interrupts

        obey_interrupts()
        from wbc.cli.app import app

        app()
    except KeyboardInterrupt:
        # While the interpreter still imports: nothing has begun, and nothing is to be said
        raise SystemExit(INTERRUPTED_EARLY) from None
