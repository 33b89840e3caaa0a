"""Motion retargeting: a clip of a person or an animal onto any robot, with feet that stand still."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wbc import lazy

if TYPE_CHECKING:
    from wbc.retarget.body import BodyError as BodyError
    from wbc.retarget.clip import Clip as Clip, Skeleton as Skeleton
    from wbc.retarget.correcting import CorrespondenceEditor as CorrespondenceEditor
    from wbc.retarget.correspondence import (
        Correspondence as Correspondence,
        CorrespondenceError as CorrespondenceError,
        LimbMatch as LimbMatch,
    )
    from wbc.retarget.figures import motion_figures as motion_figures
    from wbc.retarget.folders import (
        ClipDone as ClipDone,
        ClipJob as ClipJob,
        find_clips as find_clips,
        retarget_clips as retarget_clips,
    )
    from wbc.retarget.holding_forces import Support as Support, held as held
    from wbc.retarget.live import LiveRetargeter as LiveRetargeter
    from wbc.retarget.options import RetargetOptions as RetargetOptions, RetargetWeights as RetargetWeights
    from wbc.retarget.outputs import write_lerobot as write_lerobot, write_motion as write_motion
    from wbc.retarget.report import save_motion_film as save_motion_film, write_report as write_report
    from wbc.retarget.retargeted import GivenUp as GivenUp, MotionErrors as MotionErrors, Retargeted as Retargeted
    from wbc.retarget.retargeter import Retargeter as Retargeter
    from wbc.retarget.sources.loading import load_clip as load_clip
else:
    __getattr__, __dir__, __all__ = lazy.attach(__name__, __file__)
