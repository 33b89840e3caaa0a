"""``python -m wbc`` is the command ``wbc``."""

from wbc.cli import main

if __name__ == "__main__":
    main()
