"""What is raised of files and connections in other formats."""

from wbc.errors import WbcError


class FormatError(WbcError):
    """A run that cannot be written in a format, or a file that does not hold what is asked of it."""
