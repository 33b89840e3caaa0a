"""The scene: robot, targets that can be dragged, obstacles, and lines that say how near things are."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc.api import Controller
from wbc.controller import core_of
from wbc.geometry import ShapeTable, distances
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.rotations import TO_MUJOCO, quaternion
from wbc.shapes import PlacedShape
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import joint_of
from wbc.tasks import CenterOfMass, EndEffector, Hold, Obstacle, PitchPlane, PitchPlaneLimit
from wbc.tasks._contact import NOMINAL, Contact
from wbc.tasks.base import Input, Task
from wbc.validation import Array
from wbc.viewer.bodies import DETAIL, Colour, DrawnMesh, bounded, robot_meshes, shape_mesh
from wbc.viewer.scenery import Scenery
from wbc.viewer.tick import Tick

if TYPE_CHECKING:
    import viser

#: A pose that moved less than this is not sent again [m, and as entries of a quaternion]
STILL = 1e-5
#: Clearances up to this are drawn [m]
NEAR = 0.25
#: The line of a clearance below this is red [m]
TIGHT = 0.03
#: Points of the path of a hand
TRAIL = 300
#: How far apart the points of a path are [m]
APART = 0.004
GREEN = (64, 160, 90)
AMBER = (230, 150, 30)
RED = (215, 50, 40)
BLUE = (40, 110, 200)
PURPLE = (130, 60, 170)
GREY = (150, 158, 168)
#: What is drawn only where it is asked for: the camera goes along, how far a hand can be
DEMANDED = ("follow", "reach")
#: Lengths of the arrows at a target, as part of the robot's; an obstacle's are shorter
GIZMO = 0.24
FLOOR = (226, 231, 236)
#: Where the sun is, up being z
SUN = np.array([0.6, -1.2, 2.0])
#: The sky above
SKY = (188, 205, 222)
#: The sky at the horizon
HORIZON = (238, 242, 246)
#: Where a page's camera looks from [m]
FROM = np.array([1.2, -1.0, 0.75])
#: Field of view of a page's camera upwards [rad]
FIELD = np.radians(45.0)
#: Part of the field of view that the robot fills
FILLED = 0.76
#: Width of the field of view over its height
WIDE = 1.35
#: In place of a quaternion for what has none
EMPTY = np.zeros(0)
#: What is told of a click at a hold: its id, number of viser's client
Picked = Callable[[str, int | None], None]
#: What is told of a drag: item, value, pose in the world, phase, number of viser's client
Dragged = Callable[[str, str, pin.SE3, str, int | None], None]


class Drawing:
    """Draws ticks of a controller into a scene of viser.

    Args:
        dragged: told of every drag; None: nothing can be dragged, as in a page that is played back.
        detail: of meshes, see :data:`wbc.viewer.bodies.DETAIL`.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        controller: Controller,
        dragged: Dragged | None = None,
        detail: float = DETAIL,
        *,
        scenery: Scenery | None = None,
        picked: Picked | None = None,
    ) -> None:
        self._scene, self._dragged = scene, dragged
        self._controller, self._stack = controller, controller.stack
        self._robot = robot = controller.stack.robot
        self._size = size(robot)
        self._placed: dict[str, tuple[Array, Array]] = {}
        self._nodes: dict[str, Any] = {}
        self._held: set[str] = set()
        self._floor = False
        self._trails: dict[str, list[Array]] = {}
        self._demanded = set[str]()
        self._middle: Array | None = None
        self._weight = float(pin.computeTotalMass(robot.model)) * NOMINAL
        self._scenery = scenery
        scene.set_up_direction("+z" if scenery is None else scenery.up)
        _light(scene, np.array([0.0, 0.0, 1.0] if scenery is None else scenery.up))
        self._links = robot_meshes(robot, detail, None if scenery is None else scenery.dress)
        for link, mesh in self._links.items():
            self._add_mesh(f"/robot/{link}", mesh)
        self._obstacles: dict[str, Obstacle] = {}
        self._targets: dict[str, str] = {}
        blocks = core_of(controller).layout.blocks
        for name, block in blocks.items():
            item = block.entry.item
            if isinstance(item, Obstacle):
                self._obstacles[name] = item
                self._add_mesh(f"/obstacles/{name}", shape_mesh(item.parts))
            if isinstance(item, Task) and "target" in block.slots and is_place(block.slots["target"].input):
                self._targets[name] = "target"
        self._pairs = {name: self._shaped(item) for name, item in self._obstacles.items()}
        self._add_gizmos()
        if scenery is not None:
            self._add_scenery(scenery, picked)

    def show(self, tick: Tick) -> None:
        """Draw a tick."""
        if not self._floor and self._scenery is None:
            self._floor = True
            self._add_floor(tick)
        self._mark_holds(tick)
        for link in self._links:
            self._place(f"/robot/{link}", tick.pose(link))
        for name in self._obstacles:
            pose = tick.world_pose(name, "pose")
            if pose is not None:
                self._place(f"/obstacles/{name}", pose)
                self._follow(name, pose)
        for name, value in self._targets.items():
            pose = tick.world_pose(name, value)
            if pose is not None:
                self._follow(name, pose)
        self._lines("/lines/clearance", *self._clearances(tick))
        self._lines("/lines/tasks", *self._task_lines(tick))
        self._trail(tick)
        self._planes(tick)
        self._balance(tick)
        self._lines("/lines/forces", *self._forces(tick))
        self._lines("/lines/reach", *self._reach(tick))

    def demand(self, what: str, on: bool) -> None:
        """Draw one of :data:`DEMANDED` from now on, or no longer."""
        (self._demanded.add if on else self._demanded.discard)(what)
        self._middle = None

    def follow(self, server: viser.ViserServer, tick: Tick) -> None:
        """Where that is asked for, cameras go with the robot's root and first target."""
        if "follow" not in self._demanded:
            return
        frame, _ = hand_of(self._controller)
        middle = np.array(tick.pose(frame or self._robot.frame_names[1]).translation)
        if self._middle is not None and np.linalg.norm(off := middle - self._middle) > 1e-3:
            for client in server.get_clients().values():
                client.camera.position = client.camera.position + off
                client.camera.look_at = client.camera.look_at + off
            self._middle = middle
        elif self._middle is None:
            self._middle = middle

    def _forces(self, tick: Tick) -> tuple[list[Array], list[Colour]]:
        """An arrow from each contact along its force, half the robot's size for its weight on earth."""
        lines: list[Array] = []
        if not core_of(self._controller).layout.forces:
            return lines, []
        scale = 0.5 * self._size / max(self._weight, 1e-3)
        for name, wrench in tick.step.forces.items():
            item = self._stack[name].item
            assert isinstance(item, Contact)
            pose, force = tick.pose(item.frame), np.zeros(6)
            force[list(item.axes)] = wrench
            tip = scale * pose.rotation @ force[:3]
            length = float(np.linalg.norm(tip))
            if length < 1e-3 * self._size:
                continue
            aside = np.cross(tip, [0.0, 0.0, 1.0] if abs(tip[2]) < 0.9 * length else [1.0, 0.0, 0.0])
            aside *= 0.08 * length / np.linalg.norm(aside)
            end = pose.translation + tip
            back = end - 0.2 * tip
            lines += [np.array(pair) for pair in ((pose.translation, end), (end, back + aside), (end, back - aside))]
        return lines, [PURPLE] * len(lines)

    def _reach(self, tick: Tick) -> tuple[list[Array], list[Colour]]:
        """Three great circles: beyond them the first hand of an arm cannot be, whatever its joints do."""
        frame, _ = hand_of(self._controller)
        if "reach" not in self._demanded or not frame:
            return [], []
        model = self._robot.model
        joint = joint_of(model, frame)
        chain = [k for k in model.supports[joint] if k and model.joints[k].nv == 1]
        if not chain:
            return [], []
        # Between joints the distance is fixed, of a prismatic one up to its limit
        length = float(np.linalg.norm(model.frames[model.getFrameId(frame)].placement.translation))
        for k in chain[1:]:
            length += float(np.linalg.norm(model.jointPlacements[k].translation))
        for k in chain:
            if "P" in model.joints[k].shortname():
                place = model.joints[k].idx_q
                length += float(max(abs(model.lowerPositionLimit[place]), abs(model.upperPositionLimit[place])))
        if not np.isfinite(length):
            return [], []
        center = np.array(tick.joint(chain[0]).translation)
        angles = np.linspace(0.0, 2.0 * np.pi, 65)
        ring, lines = length * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1), list[Array]()
        for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
            points = center + ring[:, order]
            lines += [np.array(pair) for pair in itertools.pairwise(points)]
        return lines, [GREY] * len(lines)

    def _add_floor(self, tick: Tick) -> None:
        """A floor under the robot where it begins."""
        wide = self._size
        ground = self._lowest()
        low = min((float(tick.pose(link).translation[2]) for link in self._links), default=ground)
        # What hangs below its base is above no floor there
        if low < ground - 0.05 * wide:
            ground = low - 0.1 * wide
        self._scene.add_grid(
            "/floor",
            8 * wide,
            8 * wide,
            cell_size=wide / 4,
            section_size=wide,
            cell_color=(196, 203, 211),
            section_color=(160, 170, 181),
            plane_color=FLOOR,
            plane_opacity=1.0,
            position=(0.0, 0.0, ground),
        )

    # What stands around

    def _add_scenery(self, scenery: Scenery, picked: Picked | None) -> None:
        for k, mesh in enumerate(scenery.surfaces):
            self._add_mesh(f"/scenery/{k}", mesh)
        self._add_mesh("/holds/all", scenery.studs)
        if picked is not None:

            async def clicked(event: Any) -> None:
                hold = scenery.hit(np.array(event.ray_origin), np.array(event.ray_direction))
                if hold is not None:
                    picked(hold, event.client_id)

            # A click beside a stud is one on the surface, and means the hold next to it
            for node in ("/holds/all", *(f"/scenery/{k}" for k in range(len(scenery.surfaces)))):
                self._nodes[node].on_click(clicked)

    def mark_goal(self, hold: str) -> None:
        """The hold that was clicked."""
        assert self._scenery is not None
        self._mark("/holds/goal", self._scenery.places[self._scenery.holds.index(hold)], GREEN)

    def _mark_holds(self, tick: Tick) -> None:
        """A ball on every hold that a hand has."""
        if self._scenery is None:
            return
        held = set()
        for name, block in core_of(self._controller).layout.blocks.items():
            item = block.entry.item
            if isinstance(item, Hold) and tick.is_on(block) and (pose := tick.world_pose(name, "target")) is not None:
                node = f"/holds/of {item.frame}"
                held.add(node)
                self._mark(node, self._scenery.places[self._scenery.nearest(pose.translation)], AMBER)
        self._only("/holds/of ", held)

    def note(self, said: Mapping[str, Any]) -> None:
        """Holds that hands have, go to and that are gone, and the ways of the hands that are lifted, now and next."""
        assert self._scenery is not None
        for kind, colour in (("held", AMBER), ("reserved", BLUE), ("gone", RED)):
            shown = set()
            for hold in said.get(kind, ()):
                shown.add(node := f"/holds/{kind} {hold}")
                self._mark(node, self._scenery.places[self._scenery.holds.index(hold)], colour)
            self._only(f"/holds/{kind} ", shown)
        ways = [np.array(way) for way in said.get("ways", ())]
        pieces = [np.stack([way[:-1], way[1:]], axis=1) for way in ways]
        shades = [(PURPLE if k == 0 else GREY,) * len(piece) for k, piece in enumerate(pieces)]
        self._lines("/lines/swings", np.concatenate(pieces) if pieces else [], list(itertools.chain(*shades)))

    def _only(self, prefix: str, shown: set[str]) -> None:
        """Of the nodes with a prefix these are seen."""
        for node in (n for n in self._nodes if n.startswith(prefix)):
            if bool(self._nodes[node].visible) != (node in shown):
                self._nodes[node].visible = node in shown

    def _mark(self, node: str, place: Array, colour: Colour) -> None:
        if node not in self._nodes:
            self._nodes[node] = self._scene.add_icosphere(node, 0.05 * self._size, color=colour)
        self._place(node, pin.SE3(np.eye(3), np.array(place, dtype=float)))

    # What can be dragged

    def _add_gizmos(self) -> None:
        if self._dragged is None:
            return
        for name in (*self._targets, *self._obstacles):
            slot = core_of(self._controller).layout.blocks[name].slots
            value = "pose" if name in self._obstacles else "target"
            turns = slot[value].input.kind == "pose"
            node = f"/gizmos/{name}"
            scale = GIZMO * self._size * (1.0 if name in self._targets else 0.6)
            gizmo = self._scene.add_transform_controls(
                node,
                scale=scale,
                disable_rotations=not turns or name in self._obstacles,
                depth_test=False,
                line_width=3.0,
            )
            self._nodes[node] = gizmo
            gizmo.on_update(self._listener(name, value, node))

    def _listener(self, name: str, value: str, node: str) -> Callable[[Any], Any]:
        async def listen(event: Any) -> None:
            if event.phase == "start":
                self._held.add(node)
            elif event.phase == "end":
                self._held.discard(node)
            gizmo = event.target
            turn = pin.Quaternion(*(float(x) for x in gizmo.wxyz)).normalized().matrix()
            assert self._dragged is not None
            self._placed.pop(node, None)
            self._dragged(
                name, value, pin.SE3(turn, np.array(gizmo.position, dtype=float)), event.phase, event.client_id
            )

        return listen

    def _follow(self, name: str, pose: pin.SE3) -> None:
        """A gizmo that nobody holds is where the controller has its value."""
        node = f"/gizmos/{name}"
        if node in self._nodes and node not in self._held:
            self._place(node, pose)

    def let_go(self) -> None:
        """Nobody holds a gizmo any more, as who did is gone."""
        self._held.clear()
        self._placed.clear()

    # Lines

    def _shaped(self, item: Obstacle) -> tuple[list[tuple[str, PlacedShape]], ShapeTable]:
        """(link, shape) of those that keep clear, and these before the parts of the obstacle for the kernel."""
        joint = {link: joint_of(self._robot.model, link) for link in self._robot.shapes}
        links = [link for link in joint if joint[link] and (item.links is None or link in item.links)]
        shaped = [(link, placed) for link in links for placed in self._robot.shapes[link]]
        return shaped, ShapeTable([*(placed.shape for _, placed in shaped), *item.parts])

    def _clearances(self, tick: Tick) -> tuple[list[Array], list[Colour]]:
        """The shortest line from each link that is near to each obstacle."""
        lines, colours = [], []
        for name, item in self._obstacles.items():
            pose = tick.world_pose(name, "pose")
            margin = tick.numbers(name, "margin")
            if pose is None or not tick.is_on(core_of(self._controller).layout.blocks[name]):
                continue
            nearest: dict[str, tuple[float, Array]] = {}
            (shaped, table), parts = self._pairs[name], len(item.parts)
            poses = [tick.pose(link) * placed.placement for link, placed in shaped] + [pose] * parts
            centers = [*(placed.shape.center for _, placed in shaped), *(part.center for part in item.parts)]
            places = np.array([place(at * pin.SE3(np.eye(3), c)) for at, c in zip(poses, centers, strict=True)])
            one, other = np.divmod(np.arange(len(shaped) * parts), parts)
            for k, found in enumerate(distances(table, places, one, len(shaped) + other)):
                link, gap = shaped[k // parts][0], float(found[0])
                if gap < min(NEAR, nearest.get(link, (np.inf, None))[0]):
                    nearest[link] = gap, np.array([found[4:], found[4:] + gap * found[1:4]])
            kept = 0.0 if margin is None else float(margin[0])
            for gap, line in sorted(nearest.values(), key=lambda pair: pair[0])[:4]:
                lines.append(line)
                colours.append(RED if gap - kept < TIGHT / 10 else AMBER if gap - kept < TIGHT else GREEN)
        return lines, colours

    def _task_lines(self, tick: Tick) -> tuple[list[Array], list[Colour]]:
        """From each frame to its target where it is not there."""
        lines: list[Array] = []
        for name in self._targets:
            item = self._stack[name].item
            if isinstance(item, EndEffector):
                here, there = tick.pose(item.frame).translation, tick.world_pose(name, "target")
                if there is not None and np.linalg.norm(there.translation - here) > 1e-3:
                    lines.append(np.array([here, there.translation]))
        return lines, [RED] * len(lines)

    def _trail(self, tick: Tick) -> None:
        """The way that each hand came."""
        for name in self._targets:
            item = self._stack[name].item
            if not isinstance(item, EndEffector):
                continue
            here, trail = tick.pose(item.frame).translation, self._trails.setdefault(name, [])
            if not trail or np.linalg.norm(trail[-1] - here) > APART * self._size:
                trail.append(np.array(here))
                del trail[:-TRAIL]
                points = np.array(trail)
                pieces = np.stack([points[:-1], points[1:]], axis=1)
                self._lines(f"/lines/way of {name}", pieces, [BLUE] * len(pieces))

    def _lines(self, node: str, lines: Array | list[Array], colours: list[Colour]) -> None:
        """Line segments, sent anew where they changed."""
        points = np.array(lines, dtype=np.float32).reshape(-1, 2, 3)
        before = self._placed.get(node)
        if before is not None and before[0].shape == points.shape and np.allclose(before[0], points, atol=STILL):
            return
        self._placed[node] = np.asarray(points, dtype=np.float64), EMPTY
        shown = self._nodes.get(node)
        if not len(points):
            if shown is not None:
                shown.visible = False
            return
        shades = np.repeat(np.array(colours, dtype=np.uint8)[:, None], 2, axis=1)
        if shown is None:
            self._nodes[node] = self._scene.add_line_segments(
                node, points, shades, thickness=3.0, thickness_units="screen"
            )
            return
        shown.visible = True
        shown.points, shown.colors = points, shades

    def _planes(self, tick: Tick) -> None:
        """The plane of shoulder, elbow and wrist as a triangle."""
        for entry in self._stack.entries:
            item = entry.item
            if not isinstance(item, PitchPlane | PitchPlaneLimit):
                continue
            corners = np.array([tick.pose(f).translation for f in (item.shoulder, item.elbow, item.wrist)])
            node = f"/planes/{entry.name}"
            if node not in self._nodes:
                self._nodes[node] = self._scene.add_mesh_simple(
                    node, corners, np.array([[0, 1, 2]]), color=BLUE, opacity=0.35, side="double", cast_shadow=False
                )
            elif node not in self._placed or not np.allclose(self._placed[node][0], corners, atol=STILL):
                self._nodes[node].vertices = corners
            self._placed[node] = corners, EMPTY

    def _balance(self, tick: Tick) -> None:
        """Centre of mass, the point below it, and the polygon of what the robot stands on."""
        items = [entry.item for entry in self._stack.entries]
        if not any(isinstance(item, CenterOfMass) for item in items):
            return
        center = tick.center_of_mass()
        feet = [tick.pose(item.frame).translation for item in items if isinstance(item, Hold | Contact)]
        around = np.mean(feet, axis=0) if feet else np.zeros(3)
        feet.sort(key=lambda foot: float(np.arctan2(foot[1] - around[1], foot[0] - around[0])))
        low = min((float(foot[2]) for foot in feet), default=self._lowest())
        below = np.array([center[0], center[1], low])
        if "/com" not in self._nodes:
            self._nodes["/com"] = self._scene.add_icosphere("/com", 0.03 * self._size, color=AMBER)
        self._place("/com", pin.SE3(np.eye(3), center))
        ring = [*feet, feet[0]] if len(feet) > 2 else feet
        edges = [np.array(pair) for pair in itertools.pairwise(ring)]
        self._lines("/lines/balance", [np.array([center, below]), *edges], [AMBER] + [GREEN] * len(edges))

    # Nodes

    def _add_mesh(self, node: str, mesh: DrawnMesh) -> None:
        self._nodes[node] = self._scene.add_mesh_simple(
            node, mesh.corners, mesh.triangles, color=mesh.colour, side="double"
        )

    def _place(self, node: str, pose: pin.SE3) -> None:
        """Where a node is; nothing is sent where it did not move."""
        at, turn = np.array(pose.translation), quaternion(pose.rotation)[TO_MUJOCO]
        before = self._placed.get(node)
        if before is not None:
            same = min(np.abs(turn - before[1]).max(), np.abs(turn + before[1]).max()) < STILL
            if same and np.abs(at - before[0]).max() < STILL:
                return
        self._placed[node] = at, turn
        handle = self._nodes[node]
        handle.position, handle.wxyz = at, turn

    def _lowest(self) -> float:
        """Height of the floor: under everything at the neutral configuration [m]."""
        if self._robot.base_nv == 0:
            return 0.0
        data = self._robot.model.createData()
        pin.framesForwardKinematics(self._robot.model, data, self._robot.neutral)
        return min(float(frame.translation[2]) for frame in data.oMf)


def hand_of(controller: Controller) -> tuple[str, int]:
    """(frame, rows) of the first end-effector task, ("", 0) where there is none."""
    for entry in controller.stack.entries:
        if isinstance(entry.item, EndEffector):
            return entry.item.frame, 6 if entry.item.kind == "pose" else 3
    return "", 0


def is_place(declared: Input) -> bool:
    """A pose, or a point in metres: what a gizmo can stand for."""
    return declared.kind == "pose" or (declared.kind == "vector" and declared.size == 3 and declared.unit == "m")


def size(robot: Robot) -> float:
    """What gizmos and floor are measured by [m]."""
    return float(np.clip(robot.characteristic_length, 0.1, 30.0))


def look(server: viser.ViserServer, controller: Controller, tick: Tick, scenery: Scenery | None = None) -> None:
    """Where a page's camera begins."""
    camera = server.initial_camera
    camera.fov = float(FIELD)
    if scenery is None:
        camera.position, camera.look_at = viewpoint(controller, tick)
        return
    body = tick.pose(scenery.body)
    up = np.array(scenery.up)
    ahead = body.rotation[:, 0] - (body.rotation[:, 0] @ up) * up
    away = -0.75 * ahead - 0.6 * np.cross(up, ahead) + up
    camera.position = body.translation + 2.6 * size(controller.stack.robot) * away
    camera.look_at = np.array(body.translation)
    camera.up = scenery.up


def viewpoint(controller: Controller, tick: Tick) -> tuple[Array, Array]:
    """(eye, point that it looks at): robot, targets and obstacles fill the view [m]."""
    frames = controller.stack.robot.model.frames
    points = [tick.pose(frame.name).translation for frame in frames[1:]]
    for name, block in core_of(controller).layout.blocks.items():
        item = block.entry.item
        if isinstance(item, EndEffector) and (there := tick.world_pose(name, "target")) is not None:
            points.extend(
                there.translation + 0.6 * GIZMO * size(controller.stack.robot) * np.vstack([np.eye(3), -np.eye(3)])
            )
        pose = tick.world_pose(name, "pose") if isinstance(item, Obstacle) else None
        if pose is not None and isinstance(item, Obstacle) and (solid := bounded(item.parts)):
            corners = shape_mesh(solid).corners.astype(float)
            points.extend(corners @ pose.rotation.T + pose.translation)
    back = FROM / np.linalg.norm(FROM)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    axes = np.array([right, np.cross(back, right), back])
    seen = np.array(points) @ axes.T
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    off, slope = np.abs(seen - middle), FILLED * np.tan(FIELD / 2)
    needed = np.maximum(off[:, 1], off[:, 0] / WIDE) / slope + (seen - middle)[:, 2]
    target = middle @ axes
    return target + max(float(needed.max()), 0.3) * back, target


def _light(scene: viser.SceneApi, up: Array) -> None:
    """Lights and a sky, so that a light robot stands out from what is behind it."""
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), up)
    # viser's own picture of a city as light bleaches what is bright, and the page fades in until it is computed
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", sky_color=(255, 255, 255), ground_color=(150, 156, 166), intensity=1.5)
    scene.add_light_directional("/lights/sun", color=(255, 250, 242), intensity=2.2, position=tuple(turn * SUN))
    share = np.linspace(0.0, 1.0, 64)[:, None, None]
    sky = (1.0 - share) * np.array(SKY) + share * np.array(HORIZON)
    scene.set_background_image(np.repeat(sky, 2, axis=1).astype(np.uint8), format="png")
