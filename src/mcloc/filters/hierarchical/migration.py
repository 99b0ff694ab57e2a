"""Particles that leave the region of their node for the node where they are: what the paper's first
technique does without  [Est §4, point 1].
"""

from collections.abc import Callable, Mapping

import numpy as np

from mcloc.filters.hierarchical.node import Node
from mcloc.filters.hierarchical.region import OUTSIDE, ROOT, depth_of, keys_of
from mcloc.particles import Particles


def handed_over(
    nodes: Mapping[int, Node],
    key: int,
    node: Node,
    made: Callable[[int, Particles, int], Node],
    now: Callable[[Node], Particles],
) -> dict[int, Node]:
    """The nodes with an updated one, less the particles that are outside its region: these are with
    the nodes of the same depth where they are, made if need be, and moved by what these have missed
    (`now`). What is off the whole domain stays, and so does the heaviest particle of a node that
    all would leave.
    """
    x, log_w = node.particles.states, node.particles.log_weights + np.log(len(node.particles))
    keys = keys_of(nodes[ROOT].region, node.states, depth_of(key))
    to = np.where(node.half == OUTSIDE, keys, key)
    to[to == 0] = key
    if not (to == key).any():
        to[np.argmax(log_w)] = key
    changed = dict(nodes)
    for other in np.unique(to).tolist():
        states, weights = x[:, to == other], log_w[to == other]
        if other != key and other in nodes:
            there = now(nodes[other])
            states = np.concatenate([there.states, states], axis=1)
            weights = np.concatenate([there.log_weights + np.log(len(there)), weights])
        if not np.isfinite(weights).any():
            weights = np.zeros(len(weights))
        changed[other] = made(other, Particles.normalized(states, weights), node.updated)
    return changed
