"""Tasks and constraints: declarative objects, one idea a file (floor 3)."""

from wbc.tasks._stereographic import PlaneReference
from wbc.tasks.axis_align import AxisAlign
from wbc.tasks.base import Bounds, Constraint, Form, Input, Item, Order, Row, Rows, Task, Values, registry
from wbc.tasks.center_of_mass import CenterOfMass
from wbc.tasks.damping import Damping
from wbc.tasks.distance import Distance
from wbc.tasks.elbow import Elbow
from wbc.tasks.end_effector import EndEffector
from wbc.tasks.expression import Expression
from wbc.tasks.fixed import Fixed
from wbc.tasks.frame_velocity_limit import FrameVelocityLimit
from wbc.tasks.hold import Hold
from wbc.tasks.joint_limits import JointLimits
from wbc.tasks.look_at import LookAt
from wbc.tasks.mechanism import Mechanism
from wbc.tasks.momentum import Momentum
from wbc.tasks.obstacle import Obstacle
from wbc.tasks.pitch_plane import PitchPlane
from wbc.tasks.pitch_plane_limit import PitchPlaneLimit
from wbc.tasks.posture import Posture

__all__ = [
    "AxisAlign",
    "Bounds",
    "CenterOfMass",
    "Constraint",
    "Damping",
    "Distance",
    "Elbow",
    "EndEffector",
    "Expression",
    "Fixed",
    "Form",
    "FrameVelocityLimit",
    "Hold",
    "Input",
    "Item",
    "JointLimits",
    "LookAt",
    "Mechanism",
    "Momentum",
    "Obstacle",
    "Order",
    "PitchPlane",
    "PitchPlaneLimit",
    "PlaneReference",
    "Posture",
    "Row",
    "Rows",
    "Task",
    "Values",
    "registry",
]
