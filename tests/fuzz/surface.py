"""Random calls of everything public: each may only answer, or refuse with a :class:`wbc.WbcError`.

A call is a public callable with good arguments of which one or more are spoiled. Callables are found by walking the
public modules and the attributes of the objects that :mod:`tests.fuzz.goods` builds; no list names them.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import io
import signal
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.goods import Goods
from tests.fuzz.hostile import hostile, spoiled, spoiled_entries
from wbc.controller.handle import Handle
from wbc.errors import WbcError
from wbc.tasks import Constraint, Item, Task

#: What a user imports from
MODULES = (
    *("wbc", "wbc.robots", "wbc.robot", "wbc.shapes", "wbc.tasks", "wbc.trajectory", "wbc.proximity"),
    *("wbc.coordinates", "wbc.analysis", "wbc.track", "wbc.teleop", "wbc.resolvers"),
)

#: Attributes that only the package itself calls, with arguments that it has checked: hooks of items, memory of ticks
INTERNAL = {
    *(name for base in (Item, Task, Constraint) for name in vars(base) if not name.startswith("_")),
    *("write", "tick"),
    *("layout", "checked", "apply", "assume", "put_ramped", "item_name"),
    *("sense", "key_data", "model", "within", "same_kind", "pieces_at", "pieces_before", "crossings", "ranges"),
}
#: Classes that only the package itself makes: answers, and what is made by a function or a method
MADE = (
    *("Controller", "Step", "Recording", "Online", "FunctionPath", "PosePath", "Followed", "Walker", "OperatorArm"),
    *("Arm", "Solution", "Explanation", "Replay", "PairSensor", "Robot", "Item", "Task", "Constraint", "Values"),
    *("Form", "Order", "Status", "WbcError", "Bounds", "Rows", "Row", "Certificate", "Worst", "State", "Recipe"),
    *("SacrificeOrder", "RankCertificate", "LawCertificate"),
    *("SelfPairs", "LinkPair", "ConvexParts", "Witness", "Coupling", "Path", "Advice", "CarriedMotion", "ClosedForm"),
    *("CompleteSet", "Leg", "LoopError", "MotionCue", "PairCount", "PairStack", "PairStep", "PairSurvey"),
    *("Parts", "TreeSet", "TreeSets"),
    *("Analysis", "BlockAnalysis", "Branch", "Cost", "Counts", "Determinant", "JointBlock", "Locus"),
    *("PublishedSets", "Relation", "Screened", "SymbolicJacobian", "TreeAnalysis", "TreeCertificate", "Value", "Seen"),
    *("Sample", "Basis", "Condition", "Mode", "MissingPartError", "RateFileError", "PointSet", "Resolver", "Source"),
    *("Coordinate", "TREES", "PRESETS", "ALGORITHMS"),
    *("WalkerArm", "LawCertificate", "RankCertificate", "RankWitness", "LocusBranch"),
    # Algebra of polynomials that only the package makes
    *("Exact", "Notation", "factored_determinant", "joint_roots", "singular_vector_locus", "sub_determinant_locus"),
)  # fmt: skip
#: What decides how long a call takes is always given
LONG = ("states", "size", "seconds", "samples", "restarts", "budget", "cells", "intervals", "backend")
#: Longest time of one call [s]
PATIENCE = 10.0


class Hang(BaseException):
    """A call took longer than :data:`PATIENCE`."""


@dataclass(frozen=True)
class Callee:
    """A public callable; ``subject``: name of the object of :class:`Goods` that it is an attribute of."""

    name: str
    subject: str
    function: Callable[[Goods], Callable[..., Any]]


def surface(goods: Goods) -> list[Callee]:
    """All public callables."""
    return [*_of_modules(), *(each for name in goods.subjects for each in _of_subject(goods, name))]


def _of_modules() -> Iterator[Callee]:
    seen = set()
    for module in MODULES:
        found = importlib.import_module(module)
        for name in getattr(found, "__all__", None) or [
            k for k, v in vars(found).items() if getattr(v, "__module__", "").startswith(module) and k[0] != "_"
        ]:
            value = getattr(found, name)
            # a protocol is for type checkers: it has no objects
            protocol = getattr(value, "_is_protocol", False)
            own = getattr(value, "__module__", "").startswith("wbc")
            if callable(value) and own and not protocol and name not in MADE and id(value) not in seen:
                seen.add(id(value))
                # "load" is the name of two functions
                key = name if inspect.isclass(value) else f"{module.removeprefix('wbc.')}.{name}"
                yield Callee(key, "", lambda _, value=value: value)


def _of_subject(goods: Goods, subject: str) -> Iterator[Callee]:
    value = goods.subjects[subject]()
    # What handles share is known by one name
    kind = Handle if isinstance(value, Handle) else type(value)
    for name in dir(value):
        if name.startswith("_") or name in INTERNAL:
            continue
        # A controller has the C of its step in place of the method
        static = inspect.getattr_static(kind, name, inspect.getattr_static(value, name, None))
        if isinstance(static, property) and static.fset is None:
            continue
        if inspect.isfunction(static) or isinstance(static, classmethod | staticmethod):
            yield Callee(f"{kind.__name__}.{name}", subject, lambda g, n=name: getattr(g.subjects[subject](), n))
        elif isinstance(static, property) or name in getattr(value, "names", ()):
            yield Callee(f"{kind.__name__}.{name}=", subject, lambda g, n=name: _setter(g.subjects[subject](), n))
    for name in ("__getitem__", "__contains__", "__call__", "__eq__", "__hash__", "__repr__"):
        # None: a class whose objects are hashed by nothing, a TypeError for a wrong call
        if next((vars(base)[name] for base in kind.__mro__[:-1] if name in vars(base)), None) is not None:
            yield Callee(f"{kind.__name__}.{name}", subject, lambda g, n=name: getattr(g.subjects[subject](), n))


def _setter(value: Any, name: str) -> Callable[[Any], None]:
    def put(given: Any) -> None:
        setattr(value, name, given)

    return put


def draw(
    callee: Callee, goods: Goods, rng: np.random.Generator, bad: bool = True
) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Arguments that the signature takes, most of them good."""
    function = callee.function(goods)
    parameters = [p for p in inspect.signature(function).parameters.values() if p.name != "self"]
    positional, named = [], {}
    chosen: list[tuple[inspect.Parameter, Any]] = []
    for p in parameters:
        if p.kind is p.VAR_KEYWORD or p.kind is p.VAR_POSITIONAL:
            good = goods.value(callee.name, p.name)
            if isinstance(good, dict) and rng.random() < 0.5:
                named |= spoiled_entries(good, rng) if rng.random() < 0.5 else good
            continue
        if p.default is p.empty or p.name in LONG or rng.random() < 0.4:
            chosen.append((p, goods.value(callee.name, p.name)))
    worse = {int(rng.integers(len(chosen)))} if chosen else set()
    worse |= {k for k in range(len(chosen)) if rng.random() < 0.1}
    for k, (p, good) in enumerate(chosen):
        value = good if k not in worse else hostile(rng) if good is None else spoiled(good, rng)
        if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD) and p.default is p.empty:
            positional.append(value)
        else:
            named[p.name] = value
    return tuple(positional), {str(k): v for k, v in named.items()}


@contextlib.contextmanager
def impatient(seconds: float = PATIENCE) -> Iterator[None]:
    """Ends what takes too long, if it is Python that runs."""

    def ring(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def attempt(callee: Callee, goods: Goods, rng: np.random.Generator) -> str:
    """What one random call did: ``answered``, ``refused: ...`` or ``wrong: ...``."""
    arguments, named = draw(callee, goods, rng)
    stage = ""
    try:
        with impatient(), warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            answer = callee.function(goods)(*arguments, **named)
            stage = " in use"
            goods.use(answer, rng)
    except WbcError as error:
        with contextlib.suppress(WbcError):
            str(error)
        return f"refused: {type(error).__name__}"
    except Hang:
        return f"wrong: {callee.name} hangs{stage} {_shown(arguments, named)}"
    except Exception as error:  # noqa: BLE001 (whatever it is, it is told)
        last = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(last.filename).name}:{last.lineno}"
        text = f"{type(error).__name__}: {str(error)[:80]}"
        return f"wrong: {callee.name}{stage} {text} at {place} {_shown(arguments, named)}"
    return "answered"


def _shown(arguments: tuple[Any, ...], named: dict[str, Any]) -> str:
    parts = [_short(a) for a in arguments] + [f"{k}={_short(v)}" for k, v in named.items()]
    return f"({', '.join(parts)})"


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) < 60 else text[:57] + "..."


def calls(seed: int, k: int, count: int) -> list[tuple[str, Counter[str]]]:
    """``count`` random calls of every public callable."""
    rng = np.random.default_rng([seed, 14, k])
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="wbc-fuzz-") as folder, contextlib.chdir(folder):
        goods = Goods(Path(folder))
        for callee in surface(goods):
            for _ in range(count):
                counts[attempt(callee, goods, rng)] += 1
            if fault := goods.harmed(callee.subject):
                counts[f"wrong: after {callee.name}: {fault}"] += 1
    return [(f"calls {seed}/{k}", counts)]
