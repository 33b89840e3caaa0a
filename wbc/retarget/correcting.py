"""A correspondence corrected by hand: what leads a part of the robot is dragged to another point, in the viewer."""

from __future__ import annotations

import itertools
import os

import numpy as np

from wbc import tasks
from wbc.api import Controller, Stack
from wbc.multibody import pin
from wbc.retarget.correspondence import TRUNK, Correspondence
from wbc.retarget.robot_body import with_frame
from wbc.shapes import Convex, PlacedShape, Sphere

#: Parts of a limb that points lead, in the order of :attr:`LimbMatch.chain`
CHAIN_PARTS = ("base", "middle", "end", "tip")
#: A point that is nearer than another by less than this is not another one [m]
SAME_POINT = 1e-6
#: The skeleton stands so far beside the robot, in sizes of its own
SKELETON_ASIDE = 0.7
#: Width of a bone, as share of the skeleton's size
BONE_WIDTH = 0.02
#: Between looks at what was dragged [s]
EVERY = 0.02


class CorrespondenceEditor:
    """The robot at rest, the skeleton beside it, and a target for each part of the robot at the point that leads it.

    A target that is moved goes to the nearest point of the skeleton, which leads the part from then on; the file is
    written at once.

        editor = wbc.retarget.CorrespondenceEditor(match, "match.yaml")
        with wbc.viewer.show(editor.controller) as viewer:
            while viewer.running:
                viewer.update(editor.controller.step(editor.q))
                editor.look(viewer.stopped)

    Attributes:
        match: as corrected so far. file: of :meth:`Correspondence.save`. points: the skeleton's, as drawn [joints, 3]
            [m]. controller: of a stack with a task for each part. q: where the robot stands.

    Raises:
        CorrespondenceError: the file cannot be written.
    """

    def __init__(self, match: Correspondence, file: str | os.PathLike[str]) -> None:
        self.match, self.file = match, file
        body = match.body
        robot, data = body.robot, body.robot.model.createData()
        pin.forwardKinematics(robot.model, data, robot.neutral)
        turned = (match.skeleton.rest - match.skeleton.rest[match.pelvis]) @ match.axes @ body.axes.T * match.scale
        size = float(np.linalg.norm(np.ptp(turned, axis=0)))
        self.points = turned + body.places[0] + SKELETON_ASIDE * size * body.axes[:, 1]
        #: item -> frame of the robot, and number of the point that leads it
        trunk = {part: getattr(body, part) for part in TRUNK if getattr(match, part) >= 0 and getattr(body, part)}
        # What no joint moves follows nothing
        frames = {part: f for part, f in trunk.items() if robot.model.frames[robot.model.getFrameId(f)].parentJoint}
        self._leads = {part: int(getattr(match, part)) for part in frames}
        for limb, own in match.limbs.items():
            mine, base = body.limbs[limb], f"retarget_{limb}_base"
            place = data.oMi[mine.joints[0]].actInv(pin.SE3(np.eye(3), mine.base))
            robot = with_frame(robot, base, mine.joints[0], place)
            for part, frame, point in zip(
                CHAIN_PARTS, (base, mine.middle, mine.wrist or mine.end, mine.end), own.chain, strict=True
            ):
                frames[f"{limb} {part}"], self._leads[f"{limb} {part}"] = frame, point
        tip = next(iter(body.limbs.values())).end
        robot = robot.with_shapes({tip: [PlacedShape(Sphere(BONE_WIDTH * size), pin.SE3.Identity())]})
        stack = Stack(robot.with_self_pairs(()), dt=EVERY)
        if robot.base != "fixed":
            stack.add(tasks.Fixed((str(robot.model.names[1]),), acceleration=False), name="base")
        for item, frame in frames.items():
            stack.add(tasks.EndEffector(frame, "position"), name=item)
        cube = BONE_WIDTH * size * (np.array(list(itertools.product((0.0, 1.0), repeat=3))) - 0.5)
        bones = [(joint, parent) for joint, parent in enumerate(match.skeleton.parents) if parent >= 0]
        drawn = [Convex((self.points[list(bone), None] + cube).reshape(-1, 3)) for bone in bones]
        stack.add(tasks.Obstacle(drawn, links=(tip,), pose=pin.SE3.Identity()), name="skeleton")
        self.controller: Controller = stack.compile()
        self.q, self._stopped = robot.neutral, True
        self.controller.reset(self.q)
        self.look()
        match.save(file)

    def look(self, stopped: bool = False) -> bool:
        """Take over what was dragged since; whether anything was. Nothing is while the viewer is stopped."""
        free, changed = not (stopped or self._stopped), False
        self._stopped = stopped
        for item, point in self._leads.items():
            away = np.linalg.norm(self.points - np.asarray(self.controller[item].target), axis=1)
            if free and away.min() < away[point] - SAME_POINT:
                self._leads[item], changed = int(away.argmin()), True
            self.controller[item].target = self.points[self._leads[item]]
        self.controller["skeleton"].pose = pin.SE3.Identity()
        if changed:
            names = {item: self.match.skeleton.names[point] for item, point in self._leads.items()}
            limbs = {limb: [own.source] for limb, own in self.match.limbs.items()}
            for limb, row in limbs.items():
                row += [names.pop(f"{limb} {part}") for part in CHAIN_PARTS]
            self.match = self.match.corrected(names | {"limbs": limbs})
            self.match.save(self.file)
        return changed
