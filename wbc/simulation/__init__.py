"""What a control loop commands: the plant's contract, a loop's connection to one, kinematic and dynamic plants."""

from wbc.simulation.connection import Connection as Connection
from wbc.simulation.drives import VelocityDrive as VelocityDrive, driven as driven
from wbc.simulation.dynamics import Grip as Grip
from wbc.simulation.ground import Ground as Ground, level as level
from wbc.simulation.kinematic import KinematicPlant as KinematicPlant
from wbc.simulation.motors import Encoders as Encoders, Motors as Motors
from wbc.simulation.mujoco_grips import GrippingMujocoPlant as GrippingMujocoPlant
from wbc.simulation.mujoco_model import mujoco_model as mujoco_model, mujoco_spec as mujoco_spec
from wbc.simulation.mujoco_plant import MujocoPlant as MujocoPlant, SavedMujocoState as SavedMujocoState
from wbc.simulation.pinocchio_plant import PinocchioPlant as PinocchioPlant, SavedState as SavedState
from wbc.simulation.plant import (
    Command as Command,
    CommandKind as CommandKind,
    GripKind as GripKind,
    GrippingPlant as GrippingPlant,
    Plant as Plant,
    PlantError as PlantError,
    PlantState as PlantState,
)
from wbc.simulation.real_time import RealTime as RealTime
