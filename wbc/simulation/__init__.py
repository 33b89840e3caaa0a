"""What a control loop commands: the plant's contract, a loop's connection to one, kinematic and dynamic plants."""

from wbc.simulation.connection import Connection
from wbc.simulation.drives import VelocityDrive, driven
from wbc.simulation.dynamics import Grip
from wbc.simulation.ground import Ground, level
from wbc.simulation.kinematic import KinematicPlant
from wbc.simulation.motors import Encoders, Motors
from wbc.simulation.mujoco_grips import GrippingMujocoPlant
from wbc.simulation.mujoco_model import mujoco_model, mujoco_spec
from wbc.simulation.mujoco_plant import MujocoPlant, SavedMujocoState
from wbc.simulation.pinocchio_plant import PinocchioPlant, SavedState
from wbc.simulation.plant import (
    Command,
    CommandKind,
    GripKind,
    GrippingPlant,
    LoadedPlant,
    MovingPlant,
    Plant,
    PlantError,
    PlantState,
    WatchedPlant,
)
from wbc.simulation.real_time import RealTime

__all__ = [
    "Command",
    "CommandKind",
    "Connection",
    "Encoders",
    "Grip",
    "GripKind",
    "GrippingMujocoPlant",
    "GrippingPlant",
    "Ground",
    "KinematicPlant",
    "LoadedPlant",
    "Motors",
    "MovingPlant",
    "MujocoPlant",
    "PinocchioPlant",
    "Plant",
    "PlantError",
    "PlantState",
    "RealTime",
    "SavedMujocoState",
    "SavedState",
    "VelocityDrive",
    "WatchedPlant",
    "driven",
    "level",
    "mujoco_model",
    "mujoco_spec",
]
