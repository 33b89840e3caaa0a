"""Studies (floor 10): many trials of a scenario, over parameters and seeds, in this process or on a cluster."""

from wbc.study.carrying_out import Progress, carry_out
from wbc.study.declaration import Study, StudyError
from wbc.study.kept import Kept

__all__ = ["Kept", "Progress", "Study", "StudyError", "carry_out"]
