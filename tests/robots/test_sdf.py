"""SDF files: random trees of links in models in models, however their poses are stated; what is not held is said."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.repeats import repeats
from wbc.errors import RobotFileError
from wbc.multibody.model import GRAVITY


class RandomSdf:
    """A tree of links of one text; each part is stated in any other of its model that is there already."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        #: Scope -> what has a place there: (name within it, kind, pose in the outermost model)
        self.placed: dict[str, list[tuple[str, str, pin.SE3]]] = {"": []}
        self.texts: dict[str, list[str]] = {"": []}
        self.models = {"": pin.SE3.Identity()}
        #: How much was placed around an inner model before it
        self.before: dict[str, int] = {}
        self.links: dict[str, pin.SE3] = {}
        self.joints: dict[str, tuple[str, str, str, pin.SE3, np.ndarray]] = {}
        self.frames: dict[str, tuple[str, pin.SE3]] = {}
        self.count = int(self.rng.integers(3, 8))
        for k in range(self.count):
            self.link(k)
        for name in [*self.models][:0:-1]:  # the inner models first
            self.close(name)

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def draw(self) -> pin.SE3:
        return pin.SE3(pin.rpy.rpyToMatrix(*self.rng.uniform(-1.5, 1.5, 3)), self.rng.normal(size=3))

    def pose(self, scope: str, due: pin.SE3, usual: pin.SE3, known: int | None = None) -> str:
        """A <pose> that puts something where it is due, from what the format takes without a word or a named one of
        the first ``known`` of its model.
        """
        named, start = "", usual
        if (choices := self.placed[scope][:known]) and self.chance(0.6):
            name, _, start = choices[int(self.rng.integers(len(choices)))]
            named = f' relative_to="{name}"'
        here = start.actInv(due)
        x, y, z = here.translation.tolist()
        if self.chance(0.3):
            turn = pin.Quaternion(here.rotation).coeffs()
            return f'<pose{named} rotation_format="quat_xyzw">{x} {y} {z} {" ".join(map(str, turn))}</pose>'
        turn = pin.rpy.matrixToRpy(here.rotation)
        if self.chance(0.3):
            return f'<pose{named} degrees="1">{x} {y} {z} {" ".join(map(str, np.degrees(turn)))}</pose>'
        return f"<pose{named}>{x} {y} {z} {' '.join(map(str, turn))}</pose>"

    def link(self, k: int) -> None:
        scope = list(self.models)[int(self.rng.integers(len(self.models)))]
        if k and self.chance(0.3):
            inner = f"{scope}::m{k}" if scope else f"m{k}"
            self.before[inner] = len(self.placed[scope])
            self.models[inner], self.placed[inner], self.texts[inner] = self.draw(), [], []
            scope = inner
        there, name = self.draw(), f"l{k}"
        whole = f"{scope}::{name}" if scope else name
        self.links[whole] = there
        pose = self.pose(scope, there, self.models[scope])
        self.texts[scope].append(
            f'<link name="{name}">{pose}<inertial><mass>{k + 1}</mass><pose>.1 0 {k} 0 0 .3</pose></inertial></link>'
        )
        self.placed[scope].append((name, "link", there))
        on = name
        if self.chance(0.5):
            at, on = self.draw(), f"f{k}"
            self.frames[f"{scope}::{on}" if scope else on] = whole, at
            pose = self.pose(scope, at, there)
            self.texts[scope].append(f'<frame name="{on}" attached_to="{name}">{pose}</frame>')
            self.placed[scope].append((on, "frame", at))
        # In the outermost model, which sees all
        parent = "world" if not k else list(self.links)[int(self.rng.integers(k))]
        child = f"{scope}::{on}" if scope else on
        usual = self.frames[child][1] if child in self.frames else there
        at, kind = self.draw(), str(self.rng.choice(["revolute", "prismatic", "fixed"][: 2 if not k else 3]))
        axis = self.rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        seen, shown = "", axis
        if self.placed[""] and self.chance(0.5):
            other, _, pose_of = self.placed[""][int(self.rng.integers(len(self.placed[""])))]
            seen, shown = f' expressed_in="{other}"', pose_of.rotation.T @ at.rotation @ axis
        self.texts[""].append(
            f'<joint name="j{k}" type="{kind}">{self.pose("", at, usual)}<parent>{parent}</parent>'
            f"<child>{child}</child><axis><xyz{seen}>{' '.join(map(str, shown))}</xyz></axis></joint>"
        )
        self.placed[""].append((f"j{k}", "joint", at))
        self.joints[f"j{k}"] = parent, whole, kind, at, axis

    def close(self, name: str) -> None:
        above = name.rpartition("::")[0]
        due, frame = self.models[name], ""
        inside = [one for one in self.placed[name] if one[1] != "model"]
        if self.chance(0.5):
            by, _, due = inside[int(self.rng.integers(len(inside)))]
            frame = f' placement_frame="{by}"'
        last = name.rpartition("::")[2]
        pose = self.pose(above, due, self.models[above], self.before[name])
        self.texts[above].append(f'<model name="{last}"{frame}>{pose}{"".join(self.texts[name])}</model>')

    def text(self, world: pin.SE3) -> str:
        numbers = [*world.translation, *pin.rpy.matrixToRpy(world.rotation)]
        pose = f"<pose>{' '.join(map(str, numbers))}</pose>"
        return f'<sdf version="1.10"><model name="m">{pose}{"".join(self.texts[""])}</model></sdf>'


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_models_in_models_are_where_their_poses_say(seed: int, tmp_path: Path) -> None:
    made, file = RandomSdf(seed), tmp_path / "x.sdf"
    world = made.draw()
    file.write_text(made.text(world))
    robot = wbc.robots.load(file)
    moving = [name for name, joint in made.joints.items() if joint[2] != "fixed"]
    assert (robot.base, sorted(robot.joint_names)) == ("fixed", sorted(moving))
    q = np.random.default_rng(seed).uniform(-1.0, 1.0, robot.nq)
    moved = {"world": world}
    for name, (parent, link, kind, at, axis) in made.joints.items():
        value = q[robot.joint_names.index(name)] if kind != "fixed" else 0.0
        step = pin.SE3(pin.exp3(value * axis), np.zeros(3)) if kind == "revolute" else pin.SE3(np.eye(3), value * axis)
        moved[link] = moved[parent] * at * step * at.inverse()
    for link, there in made.links.items():
        assert robot.pose(q, link).isApprox(moved[link] * there, 1e-9), link
    for frame, (link, there) in made.frames.items():
        assert robot.pose(q, frame).isApprox(moved[link] * there, 1e-9), frame
    center = sum(
        (k + 1) * (moved[link] * there).act(np.array([0.1, 0.0, k]))
        for k, (link, there) in enumerate(made.links.items())
    ) / sum(range(1, made.count + 1))
    assert pin.centerOfMass(robot.model, robot.model.createData(), q) == pytest.approx(center, abs=1e-9)


def into_files(element: ElementTree.Element, folder: Path, rng: np.random.Generator, depth: int = 0) -> None:
    """Put every model in a model, under another name and elsewhere, into a file of its own, that is included."""
    for k, inner in enumerate(element):
        if inner.tag != "model":
            continue
        into_files(inner, folder, rng, depth + 1)
        name, place = str(inner.get("name")), folder / f"{inner.get('name')}_{depth}"
        pose, frame = inner.find("pose"), inner.attrib.pop("placement_frame", "")
        assert pose is not None
        include = ElementTree.Element("include")
        ElementTree.SubElement(include, "name").text = name
        include.append(pose)
        inner.remove(pose)
        if frame:
            ElementTree.SubElement(include, "placement_frame").text = frame
        inner.append(ElementTree.fromstring("<pose>1 2 3 0 0 1</pose>"))
        inner.set("name", "other")
        file, uri = (place / "model.sdf", f"model://{place.name}") if rng.random() < 0.5 else (place, place.name)
        ElementTree.SubElement(include, "uri").text = uri
        file.parent.mkdir(exist_ok=True)
        file.write_text(f'<sdf version="1.9">{ElementTree.tostring(inner, encoding="unicode")}</sdf>')
        element[k] = include


@pytest.mark.parametrize("seed", range(repeats(12)))
def test_included_models_are_models_in_the_model(seed: int, tmp_path: Path) -> None:
    made, file = RandomSdf(seed), tmp_path / "x.sdf"
    text = made.text(made.draw())
    file.write_text(text)
    whole, tree = wbc.robots.load(file), ElementTree.fromstring(text)
    into_files(tree[0], tmp_path, np.random.default_rng(seed))
    (tmp_path / "y.sdf").write_text(ElementTree.tostring(tree, encoding="unicode"))
    (tmp_path / "world.sdf").write_text(
        '<sdf version="1.9"><world name="w"><include><uri>model://sun</uri></include><include><uri>y.sdf</uri></include>'
        "</world></sdf>"
    )
    assert ("<include>" in (tmp_path / "y.sdf").read_text()) == (len(made.models) > 1)
    for name in ("y.sdf", "world.sdf"):
        parts, q = wbc.robots.load(tmp_path / name), whole.random(np.random.default_rng(seed))
        assert parts.frame_names == whole.frame_names
        for frame in whole.frame_names:
            assert parts.pose(q, frame).isApprox(whole.pose(q, frame), 1e-9), frame
        assert pin.crba(parts.model, parts.model.createData(), q) == pytest.approx(
            pin.crba(whole.model, whole.model.createData(), q), abs=1e-9
        )


def test_axes_of_an_included_file_are_as_its_own_version_has_them(tmp_path: Path) -> None:
    turned = ARM.replace("</joint>", "<pose>0 0 0 1 0 0</pose><axis><xyz>0 1 0</xyz></axis></joint>")
    for version, about in (("1.4", [0.0, 1.0, 0.0]), ("1.9", [0.0, np.cos(1.0), np.sin(1.0)])):
        (tmp_path / "arm.sdf").write_text(f'<sdf version="{version}"><model name="arm">{turned}</model></sdf>')
        hold = '<joint name="h" type="fixed"><parent>world</parent><child>arm::a</child></joint>'
        robot = load(f"<include><uri>arm.sdf</uri></include>{hold}", tmp_path)
        turn = pin.log3(robot.pose(np.array([0.5]), "arm::b").rotation)
        assert turn == pytest.approx(0.5 * np.array(about), abs=1e-12)


LINK = '<link name="{}"><inertial><mass>2</mass></inertial></link>'
ARM = LINK.format("a") + LINK.format("b") + '<joint name="j" type="revolute"><parent>a</parent><child>b</child></joint>'


def load(inside: str, tmp_path: Path, *, world: str = "") -> wbc.robot.Robot:
    file = tmp_path / "x.sdf"
    text = f'<model name="m">{inside}</model>'
    file.write_text(f'<sdf version="1.9">{f"<world>{world}{text}</world>" if world else text}</sdf>')
    return wbc.robots.load(file)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s + LINK.format("b"), "two elements <link> are called 'b'"),
        (lambda s: s + '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>', "'f' .* itself"),
        (lambda s: s.replace("<child>b", "<child>a"), "between the link 'a' and itself"),
        (lambda s: s.replace("<inertial>", '<inertial auto="true">', 1), "'a' states no inertia"),
        (lambda s: s + "<include><uri>model://hand</uri></include>", "'model://hand' leads nowhere"),
        (lambda s: s + "<include><uri>x.sdf</uri></include>", "x.sdf includes itself"),
        (lambda s: s + '<include merge="true"><uri>x.sdf</uri></include>', "'x.sdf' is merged"),
        (lambda s: s + '<model name="n"/><frame name="f" attached_to="n"/>', "'n', which has no link"),
        (lambda s: s.replace("<child>b", "<child>elbow") + '<frame name="elbows" attached_to="b"/>', "mean elbows"),
    ],
)
def test_what_cannot_be_held_is_refused_by_name(change: object, words: str, tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=words):
        load(change(ARM), tmp_path)  # type: ignore[operator]


def test_what_is_not_read_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    inside = ARM.replace("<inertial>", "<gravity>0</gravity><kinematic>false</kinematic><inertial>", 1)
    inside = inside.replace("<mass>2", "<mas>3</mas><mass>2", 1).replace('name="j"', 'name="j" rate="3"')
    mimic = '<axis><mimic joint="k"/><limit><lowr>1</lowr></limit></axis></joint>'
    robot = load(inside.replace("</joint>", mimic), tmp_path)
    assert robot.joint_names == ("root_joint", "j")
    said = "not read: <gravity> of link 'a', <mas> of link 'a' (did you mean mass?), <lowr> of joint 'j' (did you mean"
    assert said in caplog.text
    assert "j stays free: there is no k" in caplog.text


def test_worlds_models_that_are_static_and_rings(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    robot = load("<pose>0 0 2 0 0 0</pose>" + ARM, tmp_path, world="<gravity>0 0 -1.6</gravity>")
    assert robot.base == "floating"
    assert robot.pose(robot.neutral, "a").translation[2] == 2.0
    assert robot.model.gravity.linear[2] == -1.6
    assert load(ARM, tmp_path).model.gravity.linear[2] == GRAVITY
    assert load("<static>1</static>" + ARM, tmp_path).base == "fixed"
    assert "the model is static" in caplog.text
    ring = [("a", "b"), ("b", "c"), ("c", "a")]
    joints = "".join(f'<joint name="{a}" type="ball"><parent>{a}</parent><child>{b}</child></joint>' for a, b in ring)
    closed = load("".join(map(LINK.format, "abc")) + joints, tmp_path)
    assert (closed.base, len(closed.loops.loops)) == ("floating", 1)  # type: ignore[union-attr]
