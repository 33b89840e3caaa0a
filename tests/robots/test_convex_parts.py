"""A mesh as the hulls of its connected components."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wbc.robots
from tests.refusals import assert_refused
from tests.robots.test_shapes import urdf_points
from wbc.errors import NotFiniteError, RobotFileError, ShapeError
from wbc.robot.geometry.meshes import box_mesh
from wbc.shapes import Convex

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


def joined(*pieces: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(v) for v, _ in pieces)])
    return np.vstack([v for v, _ in pieces]), np.vstack([f + k for (_, f), k in zip(pieces, starts[:-1], strict=True)])


def depth(part: Convex, points: np.ndarray) -> np.ndarray:
    """Per point, how far it is beyond the outermost facet of a part."""
    from scipy.spatial import ConvexHull

    facets = ConvexHull(part.points).equations
    return np.asarray((points @ facets[:, :3].T + facets[:, 3]).max(axis=1))


def test_components_by_shared_vertices() -> None:
    apart = joined((CORNERS, FACES), (2 * CORNERS + 3, FACES))
    found = wbc.robots.convex_parts(*apart)
    assert [len(part.points) for part in found.parts] == [4, 4]
    assert found.parts[0].points.min() == 3.0  # the larger one first
    assert found.remarks == ()
    # The same corner written twice is one vertex
    touching = wbc.robots.convex_parts(*joined((CORNERS, FACES), (-CORNERS, FACES)))
    assert len(touching.parts) == 1
    assert len(touching.parts[0].points) == 6
    assert len(wbc.robots.convex_parts(*apart, scale=[1, 2, 3]).parts) == 2
    half = wbc.robots.convex_parts(*apart, scale=0.5).parts[0]
    np.testing.assert_array_equal(np.unique(half.points, axis=0), np.unique(CORNERS + 1.5, axis=0))


def test_inner_and_flat_components() -> None:
    box = box_mesh(np.ones(3))
    inner = (0.5 * CORNERS, FACES)
    found = wbc.robots.convex_parts(*joined((box.vertices, box.triangles), inner))
    assert len(found.parts) == 1
    assert "inside another" in found.remarks[0]
    plate = (np.array([[1.5, 0, 0], [1.5, 1, 0], [1.5, 0, 1.0]]), np.array([[0, 1, 2]]))
    far = (CORNERS + 5, FACES)
    found = wbc.robots.convex_parts(*joined((box.vertices, box.triangles), plate, far))
    assert len(found.parts) == 2
    assert "joined the nearest part" in found.remarks[0]
    assert depth(found.parts[0], plate[0]).max() <= 1e-9
    flat_inside = (plate[0] * [0.2, 0.2, 0.2], plate[1])
    found = wbc.robots.convex_parts(*joined((box.vertices, box.triangles), flat_inside))
    assert "component of 3 points is inside" in found.remarks[0]
    assert len(found.parts[0].points) == 8


#: A tetrahedron with edges of 1 unit
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{unit}</asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="n" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
<technique_common><accessor source="#n" count="4" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


@pytest.mark.parametrize(("unit", "metres"), [("", 1.0), ('<unit meter="0.01"/>', 0.01), ('<unit meter="1"/>', 1.0)])
def test_the_unit_of_a_collada_file_counts(unit: str, metres: float, tmp_path: Path) -> None:
    file = tmp_path / "part.dae"
    file.write_text(COLLADA.format(unit=unit))
    (part,) = wbc.robots.convex_parts(file, scale=[1.0, 1.0, 2.0]).parts
    np.testing.assert_allclose(np.sort(part.points, axis=0), np.sort(CORNERS * [metres, metres, 2.0 * metres], axis=0))


def test_bad_meshes(tmp_path: Path) -> None:
    for unit, reason in (("0", "its unit is 0 m"), ("inch", "its unit cannot be read")):
        (tmp_path / "x.dae").write_text(COLLADA.format(unit=f'<unit meter="{unit}"/>'))
        assert_refused(lambda: wbc.robots.convex_parts(tmp_path / "x.dae"), RobotFileError, reason)
    with pytest.raises(RobotFileError, match="no component has a volume"):
        wbc.robots.convex_parts(CORNERS * [1, 1, 0], FACES)
    for faces in (FACES + 1, FACES - 1, FACES.astype(float), FACES[:, :2], [1, 2, 3]):
        with pytest.raises(ShapeError, match="triangles"):
            wbc.robots.convex_parts(CORNERS, faces)
    for vertices in (CORNERS[:, :2], np.zeros((0, 3)), [1.0, 2.0, 3.0]):
        with pytest.raises(ShapeError, match="mesh"):
            wbc.robots.convex_parts(vertices, FACES)
    assert_refused(lambda: wbc.robots.convex_parts(CORNERS * np.nan, FACES), NotFiniteError, "mesh")
    assert_refused(lambda: wbc.robots.convex_parts(CORNERS, FACES, scale=[1, 2]), ShapeError, "scale")
    assert_refused(lambda: wbc.robots.convex_parts(tmp_path / "gone.stl"), RobotFileError, "gone.stl")


@pytest.mark.parametrize("name", ["ur5", "talos_left_arm"])
def test_links_as_convex_parts_contain_every_vertex(name: str) -> None:
    robot = wbc.robots.load(name, shapes="convex")
    meshes = 0
    if name == "ur5":
        for link, points in urdf_points(robot).items():
            parts = [s for s in robot.shapes[link] if isinstance(s.shape, Convex)]
            if not parts:
                continue
            meshes += 1
            local = [(points - s.placement.translation) @ s.placement.rotation for s in parts]
            gaps = np.min([depth(s.shape, x) for s, x in zip(parts, local, strict=True)], axis=0)
            assert gaps.max() <= 1e-9
        assert meshes == 7
    found = wbc.robots.find_self_pairs(robot, samples=20)
    assert len(found.pairs) > 10
    assert all(pair.distance is not None and np.isfinite(pair.distance) for pair in found.pairs)


def test_remarks_are_in_the_notes(tmp_path: Path) -> None:
    def facets(vertices: np.ndarray, faces: np.ndarray) -> str:
        rows = ["".join(f"vertex {x} {y} {z}\n" for x, y, z in vertices[face]) for face in faces]
        return "".join(f"facet normal 0 0 0\nouter loop\n{row}endloop\nendfacet\n" for row in rows)

    plate = (np.array([[1.5, 0, 0], [1.5, 1, 0], [1.5, 0, 1.0]]), np.array([[0, 1, 2]]))
    (tmp_path / "m.stl").write_text(f"solid m\n{facets(*joined((CORNERS, FACES), plate))}endsolid m\n")
    (tmp_path / "flat.stl").write_text(f"solid m\n{facets(*plate)}endsolid m\n")
    body = '<link name="{0}"><collision><geometry><mesh filename="{1}.stl"/></geometry></collision></link>'
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r">{body.format("a", "m")}{body.format("b", "flat")}'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    )
    robot = wbc.robots.load(tmp_path / "r.urdf", shapes="convex")
    assert set(robot.shapes) == {"a"}
    assert "a: a flat component of 3 points joined" in robot.notes["shapes"]
    assert "b: mesh: no component has a volume" in robot.notes["shapes"]
