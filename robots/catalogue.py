"""The table of robots, and ``load``."""

from __future__ import annotations

import functools
import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from wbc import validation
from wbc.errors import WbcError
from wbc.multibody import is_model, pin
from wbc.robot.loading import build, finish, looks_like_path, unknown
from wbc.robot.loops import AnyLoop
from wbc.robot.recipe import Recipe, lock_mapping
from wbc.robot.robot import Robot
from wbc.robot.sources.files import example_data_folder
from wbc.robot.sources.kinds import is_mjmodel, is_text
from wbc.robot.sources.table import read_robot, read_table

if TYPE_CHECKING:
    from mujoco import MjModel

    from wbc.robot.sources.dh import DHRow

_FOLDER = pathlib.Path(__file__).parent


@functools.cache
def _by_name() -> dict[str, Recipe]:
    return read_table(_FOLDER)


@functools.cache
def _recipe(name: str) -> Recipe | None:
    return read_robot(_FOLDER, name)


def table() -> tuple[Recipe, ...]:
    """Every robot of the table, those that cannot be loaded included (their ``problem`` says why), by name."""
    return tuple(recipe for _, recipe in sorted(_by_name().items()))


def names() -> tuple[str, ...]:
    """Names of the robots that load."""
    return tuple(recipe.name for recipe in table() if not recipe.problem)


def load(
    robot: str | os.PathLike[str] | pin.Model | MjModel | Sequence[DHRow],
    *,
    base: str | None = None,
    lock: Any = None,
    name: str | None = None,
    neutral: Mapping[str, float] | None = None,
    shapes: str = "auto",
    package_dirs: Iterable[str | os.PathLike[str]] = (),
    position_lower: Any = None,
    position_upper: Any = None,
    velocity: Any = None,
    acceleration: Any = None,
    effort: Any = None,
    loops: bool | str | os.PathLike[str] | Sequence[AnyLoop] = True,
    actuated: Sequence[str] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Robot:
    """A robot from the table, a file, a model, or a chain of Denavit-Hartenberg rows.

    Args:
        robot: a name of the table (:func:`names`), ``walker`` or ``two_ended_arm`` (see :func:`~wbc.robots.walker`), a
            name of :func:`~wbc.robots.operator_arm`, a path of a URDF, xacro, SDF, MJCF or USD file, MJCF as a string,
            a ``pin.Model``, a ``mujoco.MjModel``, or DH rows.
        base: ``fixed``, ``floating`` (free flyer: q has position and quaternion x, y, z, w), ``planar`` (x, y,
            cos, sin; any direction) or ``differential`` (planar, sideways velocity must stay 0, see
            ``Robot.locked_dofs``). Default: the table's, or the one that the model or file brings, or fixed.
        lock: joints to lock: a name, names, patterns (``"finger_*"``), or a mapping from those to a value
            [rad or m] (None: where the neutral configuration has it). Replaces the table's list; ``()`` locks none.
            Locking one end of a mimic pair locks both.
        name: of the robot; default: the table's, the file's stem, or the model's.
        neutral: joint -> value [rad or m], on top of the table's neutral configuration.
        shapes: ``auto`` (the table's spheres and capsules, else ``description``), ``description`` (primitives of
            the file, boxes and cylinders as capsules; meshes are skipped and named in the notes), ``exact`` (the
            same, boxes and cylinders as they are), ``fit`` (also a capsule around every mesh; about 0.2 s for one
            of some hundred vertices), ``spheres`` (at most four around every body), ``convex`` (``exact``, and
            convex parts of every mesh), ``none``. :func:`~wbc.robots.fit_shapes` has more choices.
        package_dirs: folders to look for ``package://NAME/...`` meshes in, besides those above the file.
        position_lower, position_upper, velocity, acceleration, effort: limits that replace the description's, in SI
            units (rad or m, s, N m or N); one number for all joints but the base, nv numbers, or a mapping from joint
            (or degree of freedom) to a number; infinite for none.
        loops: keep the closed loops of an MJCF file (``connect``, ``weld`` and ``joint`` of its equalities) or of an
            SDF file closed, see :meth:`~wbc.robot.Robot.with_loops`; False: an open tree; loops, or the path of a file
            with a row ``frame,frame,kind`` for each: these as well.
        actuated: names of the joints with motors, see :meth:`~wbc.robot.Robot.with_actuated`; ``"transmissions"``:
            those with a ``<transmission>`` in the URDF file. Default: of an MJCF file with actuators the joints that
            these move, else all.
        arguments: of a xacro file, name -> value. Such a file runs expressions and reads files that it names.

    Raises:
        MissingPackageError: what reads xacro or USD is not installed.
        DuplicateNameError: two joints of one name, or one with that of the world, ``universe``.
        LoopError: no configuration closes the loops.
        UnknownNameError: no such robot (nearest names first), base, joint or frame.
        RobotFileError: a file that is missing, a directory, unreadable, refused by the parser, or neither URDF,
            SDF nor MJCF; a base that contradicts the description.
        UnsupportedJointError: a joint that moves and that the symbolic kinematics do not cover.
        ShapeError, NotFiniteError, RangeError, BoundsError: a bad limit, lock or neutral value.

    Cannot do: shapes of SDF and USD files. What a robot cannot hold of a file is named in the log.
    """
    recipe, source, made = _find(robot)
    more, own = _loops(loops)
    changes: dict[str, Any] = {"loops": own, "more_loops": more, "actuated": actuated}
    if arguments is not None:
        given = validation.mapping("arguments", arguments, "names to values")
        changes["arguments"] = {str(key): str(value) for key, value in given.items()}
    if lock is not None:
        changes["lock"] = lock_mapping(lock)
        changes["pairs"] = ""  # other links move against each other
    if neutral is not None:
        changes["neutral"] = {**recipe.neutral, **validation.mapping("neutral", neutral, "joints to values")}
    if name is not None:
        changes["name"] = validation.instance("name", name, str, "a string")
    wanted = recipe.base if base is None and recipe.file else base
    limits = {
        "position_lower": position_lower,
        "position_upper": position_upper,
        "velocity": velocity,
        "acceleration": acceleration,
        "effort": effort,
    }
    try:
        built = build(source, replace(recipe, **changes), wanted, shapes, package_dirs, limits)
    except WbcError as error:
        if recipe.file or not isinstance(source, (str, os.PathLike)) or str(source) in str(error):
            raise
        raise error.about(str(source)) from error
    if made is None:
        return built
    from wbc.robots.walker_robot import as_made

    return as_made(built, made, lock is None and shapes == "auto", limits, neutral)


def from_dh(
    rows: Sequence[DHRow], *, base: str | None = None, tool: Any = None, name: str = "dh", **limits: Any
) -> Robot:
    """A serial chain from Denavit-Hartenberg rows.

    Args:
        rows: one a joint, from the base; see :class:`DHRow`.
        base: as in :func:`load`; default fixed.
        tool: pose of the frame ``tip`` in the last row's frame (a ``pin.SE3``, 4x4 matrix, or position and
            quaternion x, y, z, w); default: the same.
        name: of the robot.
        limits: as in :func:`load`, on top of the rows' own.

    Returns:
        A robot with the frames ``link0`` (base), ``link1`` ... (the rows' frames) and ``tip``. It has no masses.

    Raises:
        ShapeError, DuplicateNameError, UnknownNameError, RangeError, BoundsError: of rows, names and limits.
    """
    validation.instance("name", name, str, "a string")
    for key in limits:
        validation.one_of("limit", key, ("position_lower", "position_upper", "velocity", "acceleration", "effort"))
    from wbc.robot.sources.dh import read_dh

    return finish(read_dh(rows, base, tool), Recipe(name, frames={"tip": "tip"}), "none", (), limits)


def _loops(loops: Any) -> tuple[tuple[AnyLoop, ...], bool]:
    """(loops that are given, whether those of the description are kept)."""
    if isinstance(loops, (str, os.PathLike)):
        from wbc.robot.sources.loop_file import read_loops

        return read_loops(pathlib.Path(loops)), True
    if isinstance(loops, Sequence):
        return tuple(loops), True
    return (), validation.flag("loops", loops)


def _find(robot: Any) -> tuple[Recipe, Any, Robot | None]:
    """(recipe, what to read, the robot if it is one that is made here): the table's row for a name, an empty recipe
    otherwise.
    """
    if is_text(robot):
        from wbc.robot.sources.mjmodel import compiled

        robot = compiled(robot)
    # No name in the table has a folder in front
    if isinstance(robot, str) and len(pathlib.Path(robot).parts) < 2:
        recipe = _recipe(robot)
        if recipe is not None:
            pairs = str(_FOLDER / recipe.pairs) if recipe.pairs else ""
            return replace(recipe, pairs=pairs), example_data_folder() / recipe.file, None
        if not looks_like_path(robot):
            return _made(robot)
    if isinstance(robot, (str, os.PathLike)):
        return Recipe(validation.file_path("robot", robot).stem.removesuffix(".urdf")), robot, None
    if is_mjmodel(robot):
        from wbc.robot.sources.mjmodel import model_name

        return Recipe(model_name(robot)), robot, None
    return Recipe(str(robot.name) if is_model(robot) else "dh"), robot, None


def _made(name: str) -> tuple[Recipe, Any, Robot | None]:
    # Imported here: robots that are made of numbers and not of files cost every other one a tenth of its loading time
    from wbc.robots.operator_arms import OPERATOR_ARMS, operator_recipe
    from wbc.robots.walker_robot import MADE, made_here, recipe_of

    if (made := made_here(name)) is not None:
        return recipe_of(made), made.tree, made
    if name in OPERATOR_ARMS:
        return *operator_recipe(name), None
    raise unknown(name, (*_by_name(), *MADE, *OPERATOR_ARMS))
