"""Where joints of no limb rest: the links that they carry keep off what limbs do."""

from __future__ import annotations

import numpy as np

from wbc.climb.climber import Climber
from wbc.robot.joint_values import joint_values
from wbc.robot.pairs.distances import Links, Scenes
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: Postures of limbs about their rest that are looked at
SAMPLED = 16
#: How far their joints are from it at most [rad, m]
AROUND = 0.6
#: How far links keep off, as a part of the reach of the shortest limb
KEEPS_OFF = 0.06
#: By how much joints are turned or shifted, one after the other [rad, m]
TURNED_BY = np.array([0.0, -0.25, 0.25, -0.5, 0.5, -1.0, 1.0])
#: How often all of them are
ROUNDS = 2
#: What a turn by 1 rad has to win for each link that it carries, as a part of the distance to keep of one pair [1]
TURNED = 0.05
#: How far apart other links stay that are now [m]
KEPT = 0.01


def aside(climber: Climber, reach: float) -> Array:
    """The climber's rest with the joints that are of no limb, and bear none, where links that they carry keep off:

        min over angles of  mean over postures of limbs of  sum over pairs of links of  max(0, 1 - distance / wanted)

    a joint at a time, with those that follow it, where that wins more than turning it costs. Distances from limbs are
    those of capsules about links, and ``wanted`` is ``KEEPS_OFF`` of the reach [m]; pairs that no limb moves count with
    their own distance and ``KEPT``, and none of them comes nearer than that.

    Returns:
        ``(nq)`` [m, rad].
    """
    robot, model = climber.robot, climber.robot.model

    def above(frame: str) -> set[int]:
        return {int(j) for j in model.supports[model.frames[frame_index(model, frame)].parentJoint]}

    bearing = set().union(*(above(limb.frame) for limb in climber.limbs))
    followers = {coupling.follower for coupling in robot.couplings}
    idle = [j for j in range(2, model.njoints) if j not in bearing and int(model.nvs[j]) == 1]
    rows = {j: int(model.idx_vs[j]) - 6 for j in idle if int(model.idx_vs[j]) not in followers}
    # A joint carries what those that follow it do
    joint_of = {int(model.idx_vs[j]): j for j in idle}
    led = {j: {j, *(joint_of[c.follower] for c in robot.couplings if c.leader == model.idx_vs[j])} for j in rows}
    carried = {j: {link for link in robot.shapes if led[j] & above(link)} for j in rows}
    moving = {link for link in robot.shapes if climber.carrier(link) >= 0}
    links, limits = Links(robot), robot.coupled(robot.limits)
    low, high = limits.position_lower[6:], limits.position_upper[6:]
    neutral, values = (joint_values(robot, q[None])[0] for q in (robot.neutral, climber.rest))
    rng, postures = np.random.default_rng(0), np.tile(values, (SAMPLED, 1))
    own = np.concatenate([climber.joints(limb) for limb in range(len(climber.limbs))]) - 6
    postures[1:, own] += rng.uniform(-AROUND, AROUND, (SAMPLED - 1, len(own)))
    postures = np.clip(postures, low, high)

    def placed(row: int, tried: Array) -> Scenes:
        """Links in all postures, with a joint at one value after the other."""
        every = np.tile(postures, (len(tried), 1))
        every[:, row] = np.repeat(tried, SAMPLED)
        for coupling in robot.couplings:
            every[:, coupling.follower - 6] = coupling.ratio * every[:, coupling.leader - 6] + coupling.offset
        return links.place(np.hstack([np.zeros((len(every), 6)), every - neutral]))

    # Those that carry the least first
    for j, row in sorted(rows.items(), key=lambda entry: len(carried[entry[0]])) * ROUNDS:
        pairs = [pair for pair in robot.self_pairs or () if carried[j].intersection(pair)]
        limbs = [pair for pair in pairs if len(moving.intersection(pair)) == len(carried[j].intersection(pair)) == 1]
        tried = np.clip(postures[0, row] + TURNED_BY, low[row], high[row])
        scene = placed(row, tried)
        short = np.array([np.maximum(0.0, 1.0 - scene.bounds(*pair) / (KEEPS_OFF * reach)) for pair in limbs])
        near = short.sum(axis=0).reshape(len(tried), SAMPLED).mean(axis=1)
        others = [pair for pair in pairs if not moving.intersection(pair)]
        firsts = [k * SAMPLED for k in range(len(tried))]
        near_pairs = [pair for pair in others if scene.bounds(*pair)[firsts].min() < KEPT]
        apart = [[scene.distance(*pair, k) for k in firsts] for pair in near_pairs]
        kept = np.minimum(np.reshape(apart, (-1, len(tried))), KEPT)
        lacks = (1.0 - kept / KEPT).sum(axis=0)
        cost = near + lacks + TURNED * len(carried[j]) * np.abs(tried - values[row])
        allowed = [k for k in np.argsort(cost, kind="stable").tolist() if (kept[:, k] >= kept[:, 0]).all()]
        if near[0] + lacks[0] > 0.0:
            postures[:, row] = tried[allowed[0]]
    values[list(rows.values())] = postures[0, list(rows.values())]
    return np.asarray(climber.with_values(climber.rest[None], values[None])[0])
