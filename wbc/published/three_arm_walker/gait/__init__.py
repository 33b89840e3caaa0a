"""The free gait: holds, margins, swings and their tracking."""
