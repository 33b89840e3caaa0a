"""Jerk-limited laws keep their limits and end where they should: known ones and random families; judged here."""

from __future__ import annotations

import numpy as np
import pytest

from tests.repeats import repeats
from tests.trajectory.random_motions import FAMILIES, drawn, judged
from wbc.errors import WbcError
from wbc.trajectory import jerk_limited

#: A straight way that goes far and comes back; a stop of the least way whose end is faster than allowed; a slow joint
#: beside one that takes a thousand seconds
CASES = {
    "straight, and back": {
        "start": [42.0942105962296], "target": [42.09421059670408], "velocity": [30.64328908095209], "straight": True,
        "acceleration": [0.04017890149459199], "jerk": [0.1310324959493072], "lower": [-np.inf],
        "upper": [42.14664035147167], "synchronisation": "phase",
        "start_velocity": [-18.688624561022735], "start_acceleration": [-0.03252011048987531],
    },
    "a hard stop": {
        "start": [1.7785415394431099, 0.6096247368323655], "target": [1.7785415394431099, 0.6096247368323655],
        "velocity": [2.9842547582389702, 3.1137719189444213], "acceleration": [3.0857732845901955, 2.451573343385059],
        "jerk": [2.0983298139532076, 0.7326938685990952], "lower": [-np.inf, -np.inf], "synchronisation": "phase",
        "upper": [1.9068646213900762, 1.6694885389803529], "target_velocity": [0.8036164494911514, -2.129199597169078],
        "target_acceleration": [2.1240805805704683, -2.0696848390674267],
    },
    "small beside large": {
        "start": [0.03452042916662019, 0.21399462027823524], "target": [0.03452042916662019, 0.21399462027823524],
        "velocity": [20.18674167584216, 0.19371631585762902], "acceleration": [0.0374176629345546, 0.1675736154710873],
        "jerk": [2.791121291436604, 8.209334509317747], "start_velocity": [-16.47930800529626, 0.01949085096770017],
        "start_acceleration": [0.0075782905516743725, -0.14196972195546412],
    },
}  # fmt: skip


def judge(given: dict) -> None:
    law = jerk_limited(**given)
    assert law.certificate.satisfied, law.certificate
    assert {w.kind for w in law.certificate.worst.values()} == {"exact"}, law.certificate
    size = 1.0 + np.abs(given["target"]).max()
    assert np.abs(law.at(law.duration).position - given["target"]).max() < 1e-8 * size


@pytest.mark.parametrize("name", CASES)
def test_known_laws_are_kept(name):
    judge(CASES[name])


def test_random_laws_are_kept_or_refused():
    """Moving ends, limits of sizes over three decades that differ by joint and lie close, all synchronisations."""
    rng = np.random.default_rng(5)
    laws = 0
    while laws < repeats(100):
        n = int(rng.integers(1, 6))
        v, a, j = (10.0 ** rng.uniform(-1.5, 1.5, n) for _ in range(3))
        start, target = rng.normal(size=(2, n)) * 10.0 ** rng.uniform(-2, 2)
        given = {"start": start, "target": target, "velocity": v, "acceleration": a, "jerk": j}
        given["straight"] = bool(rng.random() < 0.3) and n == 1
        if rng.random() < 0.5:
            room = rng.exponential(size=(2, n)) * np.abs(target - start)
            given |= {"lower": np.minimum(start, target) - room[0], "upper": np.maximum(start, target) + room[1]}
        for end in ("start", "target"):
            if rng.random() < 0.6:
                given[f"{end}_velocity"] = v * rng.uniform(-1, 1, n)
                given[f"{end}_acceleration"] = a * rng.uniform(-1, 1, n) * rng.integers(2)
        given["synchronisation"] = str(rng.choice(["time", "phase", "none"]))
        try:
            judge(given)
        except WbcError:
            continue
        laws += 1


#: Members of a family; `python -m bench.time_laws --full` judges 10^6
MANY = repeats(200)


@pytest.mark.parametrize("name", FAMILIES)
def test_limits_are_kept_and_ends_met(name):
    rng = np.random.default_rng(17)
    family = [drawn(name, rng) for _ in range(MANY)]
    laws = [jerk_limited(**arguments) for arguments in family]
    excess, off = judged(laws, family)
    worst = int(excess.argmax())
    assert excess[worst] <= 1e-9, family[worst]
    spans = np.array([law.duration for law in laws])
    share = off / (1.0 + np.array([np.abs(a["target"]).max() for a in family])) / np.maximum(1.0, spans)
    worst = int(share.argmax())
    assert share[worst] <= 1e-10, (off[worst], family[worst])
    for law, over in zip(laws[::50], excess[::50], strict=True):
        certificate = law.certificate
        assert certificate.satisfied, certificate
        assert {w.kind for w in certificate.worst.values()} == {"exact"}, certificate
        assert abs(certificate.ratio - 1.0 - over) < 1e-9
