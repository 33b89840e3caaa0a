"""Loading robots from files, models and Denavit-Hartenberg rows; names are looked up one floor above."""

from __future__ import annotations

import logging
import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import validation
from wbc.errors import BoundsError, RobotFileError, ShapeError, UnknownNameError
from wbc.multibody import algebra, is_model
from wbc.robot.assembly import SLIGHT, assemble, override_limits
from wbc.robot.recipe import Recipe
from wbc.robot.robot import Robot, changed
from wbc.robot.sources.description import Description, with_base
from wbc.robot.sources.files import example_data_folder, read_xml
from wbc.robot.sources.kinds import USD, XACRO, is_mjmodel
from wbc.robot.sources.urdf import read_urdf

if TYPE_CHECKING:
    from wbc.robot.sources.srdf import Srdf

log = logging.getLogger("wbc")

SHAPES = ("auto", "description", "exact", "fit", "spheres", "convex", "none")

#: Choices of :data:`SHAPES` that read meshes -> kind of :func:`~wbc.robot.geometry.link_shapes.fit_shapes`.
_FITTED = {"fit": "capsule", "spheres": "spheres", "convex": "convex"}


def read(source: Any, base: str | None, recipe: Recipe) -> Description:
    """The description in a URDF, xacro, SDF, MJCF or USD file, a ``pin.Model``, a ``mujoco.MjModel`` or rows of
    :class:`~wbc.robots.DHRow`.

    Raises:
        RobotFileError: a file that is missing, unreadable or neither; ShapeError: something else altogether.
    """
    if is_mjmodel(source):
        # Imported here, as the other readers: a robot needs one of them
        from wbc.robot.sources.mjmodel import read_mjmodel

        return read_mjmodel(source, base)
    if is_model(source):
        model, kind = with_base(algebra(source).Model(source), base)
        return Description(model, kind)
    if isinstance(source, (str, os.PathLike)):
        path = pathlib.Path(source)
        if path.suffix.lower() in (XACRO, *USD) and path.is_file():
            path = _as_read(path, recipe)
        _, tree = read_xml(path)
        if tree.tag == "robot":
            if unexpanded := [
                element.tag.rpartition("}")[2] for element in tree.iter() if "/xacro}" in str(element.tag)
            ]:
                reason = f"it has <xacro:{unexpanded[0]}>: call it {path.stem}{XACRO}, and it is expanded"
                raise RobotFileError("robot", str(path), reason)
            return read_urdf(path, tree, base, recipe.mimic_leaders)
        if tree.tag == "mujoco":
            from wbc.robot.sources.mjmodel import compiled, read_mjmodel

            return read_mjmodel(compiled(path), base, str(path))
        if tree.tag == "sdf":
            from wbc.robot.sources.sdf import read_sdf

            return read_sdf(path, tree, base)
        raise RobotFileError("robot", str(path), f"neither URDF, SDF nor MJCF: the root element is <{tree.tag}>")
    if isinstance(source, Sequence) and source:
        from wbc.robot.sources.dh import DHRow, read_dh

        if all(isinstance(row, DHRow) for row in source):
            return read_dh(source, base)
    expected = "expected a name, a path, a pin.Model, a mujoco.MjModel or a sequence of DHRow"
    raise ShapeError("robot", source, expected)


def _as_read(path: pathlib.Path, recipe: Recipe) -> pathlib.Path:
    """The URDF or SDF file, in the cache, that a xacro or USD file is made into."""
    if path.suffix.lower() == XACRO:
        from wbc.robot.sources.xacro import expanded

        return expanded(path, recipe.arguments)
    if recipe.arguments:
        raise RobotFileError("arguments", dict(recipe.arguments), "only xacro files take arguments")
    from wbc.robot.sources.usd import converted

    return converted(path)


def build(
    source: Any,
    recipe: Recipe,
    base: str | None = None,
    shapes: str = "auto",
    package_dirs: Iterable[Any] = (),
    limits: Mapping[str, Any] | None = None,
) -> Robot:
    """The robot of a source, made as the recipe says.

    Raises:
        WbcError: see ``wbc.robots.load``.
    """
    validation.one_of("shapes", shapes, SHAPES)
    return finish(read(source, base, recipe), recipe, shapes, package_dirs, limits or {})


def finish(
    description: Description,
    recipe: Recipe,
    shapes: str,
    package_dirs: Iterable[Any],
    limits: Mapping[str, Any],
) -> Robot:
    """The robot of a description: states, joints, limits, shapes."""
    states, geometry = dict(description.states), description.geometry
    if recipe.srdf:
        from wbc.robot.sources.srdf import read_srdf

        srdf = read_srdf(example_data_folder() / recipe.srdf)
        description = _with_rotors(description, srdf)
        states |= srdf.states() if recipe.state else {}
    if not recipe.state and "home" in states:
        recipe = replace(recipe, state="home")
    robot = _followed(override_limits(assemble(description, recipe, states), limits))
    if shapes == "none" or not (robot.source or recipe.shapes or geometry is not None):
        return robot
    if shapes == "auto" and recipe.shapes:
        return _with_pairs(_table_shapes(robot, recipe), recipe, recipe.pairs)
    from wbc.robot.geometry.link_shapes import description_shapes, fit_shapes

    if shapes in _FITTED:
        meshes = geometry if is_mjmodel(geometry) else None
        fitted = fit_shapes(robot, kind=_FITTED[shapes], package_dirs=package_dirs, geometry=meshes)
        return _with_pairs(fitted, recipe)
    described = description_shapes(robot, package_dirs, exact=shapes == "exact", geometry=geometry)
    return _with_pairs(described, recipe)


def _followed(robot: Robot) -> Robot:
    """The robot, with a warning and a note of leaders whose range their followers' own limits cut.

    Raises:
        BoundsError: no value of a leader is left.
    """
    own, names, said = robot.limits, robot.dof_names, []
    try:
        left = robot.coupled(own)
    except BoundsError as error:
        raise error.about(robot.source or robot.name) from None
    for one in robot.couplings:
        low, high = own.position_lower[one.leader], own.position_upper[one.leader]
        if one.ratio == 0.0 or not np.isfinite([low, high]).all():
            continue
        ends = one.of_leader(own.position_lower[one.follower], own.position_upper[one.follower])
        if max(ends[0] - low, high - ends[1]) > SLIGHT:
            kept = f"{left.position_lower[one.leader]:.6g} to {left.position_upper[one.leader]:.6g}"
            whole = f"{names[one.leader]} has {kept} of its {low:.6g} to {high:.6g} left"
            said.append(f"{whole}, by the limits of {names[one.follower]}, which follows it")
    if not said:
        return robot
    log.warning("%s: %s", robot.source or robot.name, "; ".join(said))
    before = [robot.notes["mimic"]] if "mimic" in robot.notes else []
    return changed(robot, notes={**robot.notes, "mimic": "; ".join([*before, *said])})


def _with_rotors(description: Description, srdf: Srdf) -> Description:
    """The description with the rotors of an SRDF file, as ``pin.loadRotorParameters``, and notes of what is not read.

        armature += inertia gear_ratio^2

    Raises:
        RobotFileError: a bad rotor, or one of a joint with several degrees of freedom.
    """
    model, notes, rotors = algebra(description.model).Model(description.model), dict(description.notes), srdf.rotors()
    here = [name for name in rotors if model.existJointName(name)]
    several = [name for name in here if model.nvs[model.getJointId(name)] != 1]
    if several:
        raise RobotFileError("srdf", str(srdf.path), f"rotors of joints with several degrees of freedom: {several}")
    dofs = [int(model.idx_vs[model.getJointId(name)]) for name in here]
    armature, inertias, ratios = (np.array(x) for x in (model.armature, model.rotorInertia, model.rotorGearRatio))
    for i, name in zip(dofs, here, strict=True):
        inertias[i], ratios[i] = rotors[name]
    armature[dofs] += inertias[dofs] * ratios[dofs] ** 2
    model.armature, model.rotorInertia, model.rotorGearRatio = armature, inertias, ratios
    if rotors:
        without = [name for name in list(model.names)[1:] if name not in rotors]
        notes["armature"] = f"rotors of the SRDF file; none given for {', '.join(without) or 'no joint'}"
    if ignored := srdf.ignored():
        notes["srdf"] = f"not read of the SRDF file: {ignored}"
    followers = {mimic.follower for mimic in description.mimics}
    passive = [name for name in srdf.passive() if model.existJointName(name) and name not in followers]
    if passive:
        notes["passive"] = f"passive joints of the SRDF file, which have motors here: {', '.join(passive)}"
        log.warning("%s: %s", description.source or model.name, notes["passive"])
    return replace(description, model=model, notes=notes)


def _table_shapes(robot: Robot, recipe: Recipe) -> Robot:
    """The spheres and capsules that the table holds, checked against the robot's frames."""
    shapes: dict[str, list[Any]] = {}
    for shape in recipe.shapes:
        shapes.setdefault(shape.link, []).append(shape.placed())
    largest = max(shape.excess for shape in recipe.shapes)
    note = f"{len(recipe.shapes)} shapes on {len(shapes)} links from the table, largest excess {largest:.4g} m"
    return changed(robot.with_shapes(shapes), notes={**robot.notes, "shapes": note})


def _with_pairs(robot: Robot, recipe: Recipe, file: str = "") -> Robot:
    """The robot with the pairs of links that must not touch: from a file, else what is known without sampling."""
    if sum(map(bool, robot.shapes.values())) < 2:
        return robot
    from wbc.robot.pairs.collision_pairs import find_self_pairs
    from wbc.robot.pairs.pairs_file import read_self_pairs

    if file:
        found = read_self_pairs(file, robot)
    else:
        srdf = example_data_folder() / recipe.srdf if recipe.srdf else None
        found = find_self_pairs(robot, srdf=srdf, samples=0)
    note = found.summary()
    touching = [" and ".join(pair.links) for pair in found.pairs if pair.reason == "neutral"]
    if touching:
        note += f"; not watched, as they touch in the neutral configuration: {', '.join(touching)}"
    return changed(robot.with_self_pairs(found.kept), notes={**robot.notes, "self_pairs": note})


def looks_like_path(text: str) -> bool:
    """Whether a string that is no known robot name is meant as a path."""
    path = pathlib.Path(text)
    return path.suffix != "" or len(path.parts) > 1 or validation.exists("robot", text)


def unknown(name: str, names: Iterable[str]) -> UnknownNameError:
    """The error for a robot name that the table does not have."""
    return UnknownNameError("robot", name, names)
