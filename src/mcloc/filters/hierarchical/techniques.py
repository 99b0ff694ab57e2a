"""The five techniques that a hierarchy needs beside its nodes, each of which can be left out  [Est
§4, points 1–5].
"""

from dataclasses import dataclass

from mcloc.registry import Configurable, param


@dataclass(frozen=True)
class Techniques(Configurable):
    """The paper's five, in its order, with its defaults.

    1. stay: particles stay with their node, m_d of them, also where the robot is not; else those
       that leave its region go over to the node where they are, which grows.
    2. collect: states outside a node's region are brought back to near its border, so that a move
       may bring them into it; else they are left wherever they are.
    3. virtual: in so many levels from the root on, sensors are virtual low-resolution ones.
    4. random: a share of random particles, anywhere in the entire domain, enters when particles are
       weighed.
    5. conditioned: each level is updated before it says which of its halves is updated next; else
       those nodes are that were on the path before.
    """

    stay: bool = param(True, "", "whether particles stay with their node")
    collect: bool = param(True, "", "whether states outside a node's region are kept near it")
    virtual: int = param(3, "", "levels with virtual low-resolution sensors", low=0, high=60)
    random: float = param(0.1, "", "share of random particles", low=0, high=0.99)
    conditioned: bool = param(True, "", "whether the path follows the updated belief")
