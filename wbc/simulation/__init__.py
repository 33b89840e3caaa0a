"""What a control loop commands: the plant's contract, a loop's connection to one, and the kinematic plant."""

from wbc.simulation.connection import Connection
from wbc.simulation.kinematic import KinematicPlant
from wbc.simulation.mujoco_plant import MujocoPlant
from wbc.simulation.plant import Command, CommandKind, Plant, PlantError, PlantState

__all__ = ["Command", "CommandKind", "Connection", "KinematicPlant", "MujocoPlant", "Plant", "PlantError", "PlantState"]
