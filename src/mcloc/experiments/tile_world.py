"""A robot on a row of tiles that wants to be in the middle: the world of E18 to E21  [Est §2.1,
§4.1].
"""

import itertools
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mcloc.draws import Draws
from mcloc.environment import Tiles
from mcloc.filters.filter import Filter, StepInfo
from mcloc.filters.hierarchical.description import FullStates
from mcloc.filters.hierarchical.domain import TileRows
from mcloc.filters.hierarchical.hierarchical_mcl import HierarchicalMCL
from mcloc.filters.hierarchical.node import Allocation, Equal, Halving
from mcloc.filters.hierarchical.nodes import FORGOTTEN
from mcloc.filters.hierarchical.region import Region
from mcloc.filters.hierarchical.sensing import Sensing
from mcloc.filters.hierarchical.techniques import Techniques
from mcloc.filters.hierarchical.zones import ZoneOnly
from mcloc.filters.particle_filter import Part, ParticleFilter
from mcloc.filters.recovery import NoRandomParticles
from mcloc.motion.tiles import TileMotion, transition
from mcloc.proposals.forward import Forward
from mcloc.proposals.renewed import Renewed
from mcloc.protocols import SensorModel
from mcloc.resampling import Multinomial
from mcloc.sample_size import Fixed
from mcloc.sensors.grey_tile import PreciseGreyTile
from mcloc.sensors.low_resolution import LowResolution
from mcloc.statespace import LINE, PLANE

TILES = 128
LEVELS = 7  # 2^7 = 128
VIRTUAL = 3  # of them
EFOLDS = 10.0  # by which the likelihood of a virtual sensor falls over the width of a region
RANDOM = 0.1
NEAR, IN_A_ROW = 5, 20
NEVER = NoRandomParticles(
    doubt_below=0.0
)  # no doubt in the wheels, nor random particles of its own

VANILLA_6, VANILLA_36, VANILLA_36_COARSE = "vanilla 6 coarse", "vanilla 36", "vanilla 36 coarse"
EACH_6, HALVING_36 = "hierarchical 6", "hierarchical 36"
PAPERS = (VANILLA_6, VANILLA_36, VANILLA_36_COARSE, EACH_6, HALVING_36)
WITHOUT_RANDOM = tuple(f"{name}, none random" for name in PAPERS[:3])
ZONES = f"{HALVING_36}, zones"

WORLD = f"""
A row of {TILES} tiles whose grey values are their numbers. At each iteration the robot steps to the
left, to the right or stays, and does so with probability 1/2; else what it could have done instead
happens. Then it reads the tile's grey value, which is off by up to *off_by* tiles, all of these
values being as likely (5 is what the paper says of its experiment, 1 that of its text). The
robot starts on the first tile and steps towards the middle of the row from where it believes to be:
the tile with most of the belief. The paper tells no more than that; so the rest is ours:

- *vanilla*: MCL as in its Fig. 1, with 6 or 36 particles, {100 * RANDOM:.0f} % of them random:
  without these a filter with a precise sensor finds a robot that was carried off in few runs, where
  the paper's does. *None random* is without.
- *coarse*: the virtual low-resolution sensor. The paper asks three properties of it and gives no
  formula. Here a value explains a tile as well as it explains the best tile around, less what that
  is away: over the width of the node's region, or of the row for vanilla MCL, the likelihood falls
  by {EFOLDS:.0f} powers of e.
- *hierarchical 6*: {LEVELS} levels, down to single tiles, each node with 6 particles.
  *hierarchical 36*: 36 at the root and half as many in each level, but no less than 6. The
  {VIRTUAL} levels at the top, about half of them, have virtual sensors. A node keeps states up to a
  tile outside its region, which is how far a step leads.
- A measurement that none of a set's particles explains leaves their weights as they are. A node
  that the path has not come to for more than {FORGOTTEN} iterations is made anew, of random
  particles.
- *zones*: particles only say in which half they are.
- A node that the path comes back to has what it had when it was left, moved by the steps since; a
  new one random particles. Nothing is taken over from the node above, as `mcloc run` has it.
- As in the paper a robot has *reached* its place when its error is below {NEAR} tiles for the first
  time. It has *settled* when that begins to hold for {IN_A_ROW} iterations in a row, for the paper
  judges by curves, on which a lucky iteration does not show. Claims about when it is *there* are
  asked by both. What is not reached in a run counts as the iteration after its last one. *Peaks*
  are iterations whose error is {NEAR} tiles or more.
"""


class TileSensor(SensorModel, Protocol):
    """A sensor above tiles."""

    @property
    def shape(self) -> tuple[int, ...]:
        """How many there are along each axis."""

    def sample(self, x: NDArray[np.float64], rng: np.random.Generator) -> Any:
        """What is read on a tile x (D,)."""


def domain(sensor: TileSensor) -> TileRows:
    """All tiles that a sensor knows, along one axis or two."""
    n = np.array(sensor.shape, dtype=np.float64)
    space = LINE if len(n) == 1 else PLANE
    return TileRows(Region(space, np.full(len(n), -0.5), n - 0.5), Tiles(sensor.shape))


def from_afar(sensor: SensorModel, region: Region) -> LowResolution:
    """A virtual low-resolution sensor for a region: over its width the likelihood falls by EFOLDS
    powers of e, and that is as far as it looks.
    """
    return LowResolution(sensor, 1.0, *_around(region))


@lru_cache(maxsize=256)
def _around(region: Region) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offsets and falls of its virtual sensor."""
    reach = [np.arange(-side, side + 1.0) for side in np.floor(region.sides)]
    offsets = np.array([o for o in itertools.product(*reach) if any(o)], dtype=np.float64).T
    return offsets, EFOLDS * np.abs(offsets / region.sides[:, None]).sum(axis=0)


def parts_of(n: int, share: float = RANDOM) -> tuple[Part, ...]:
    """Those of vanilla MCL with n particles, a share of them random."""
    return (Part(1.0, Renewed(Forward(Multinomial()), share), Fixed(n)),)


def vanilla(sensor: TileSensor, n: int, coarse: bool, share: float = RANDOM) -> ParticleFilter:
    """MCL over all tiles."""
    tiles = domain(sensor)
    seen = from_afar(sensor, tiles.whole) if coarse else LowResolution(sensor)
    models = TileMotion(sensor.shape), seen, tiles.environment
    return ParticleFilter(*models, parts_of(n, share), NEVER, tiles.whole.space)


def hierarchy(
    sensor: TileSensor,
    allocation: Allocation,
    *,
    levels: int = LEVELS,
    techniques: Techniques | None = None,
    zones: bool = False,
    coarse: Mapping[str, float] | None = None,
) -> HierarchicalMCL:
    """Hierarchical MCL over all tiles. coarse: as of Sensing."""
    tiles = domain(sensor)
    chosen = techniques or Techniques(virtual=VIRTUAL, random=RANDOM)
    return HierarchicalMCL(
        TileMotion(sensor.shape),
        sensor,
        tiles,
        ZoneOnly(tiles) if zones else FullStates(tiles, np.ones(len(sensor.shape))),
        allocation,
        lambda n: parts_of(n, chosen.random),
        Sensing(from_afar, coarse or {}),
        chosen,
        levels,
        0.0,
        NEVER,
    )


@cache
def filter_named(name: str, error: int) -> Filter[Any]:
    """One of those that the studies compare."""
    sensor = PreciseGreyTile((TILES,), error=error)
    halving = Halving(particles=36, floor=6)
    if name == EACH_6:
        return hierarchy(sensor, Equal(particles=6))
    if name == ZONES:
        return hierarchy(sensor, halving, zones=True)
    if name == HALVING_36:
        return hierarchy(sensor, halving)
    share = 0.0 if name in WITHOUT_RANDOM else RANDOM
    return vanilla(sensor, 6 if name.startswith(VANILLA_6) else 36, "coarse" in name, share)


def believed(filter: Filter[Any], bel: Any) -> int:
    """The tile with most of the belief; of a hierarchy in the smallest region it answers."""
    particles = bel.particles
    if isinstance(filter, HierarchicalMCL):
        particles = filter.query(bel).particles or particles
    return int(np.bincount(particles.states[0].astype(np.intp), particles.weights).argmax())


def driven(
    filter: Filter[Any],
    sensor: TileSensor,
    seed: int,
    iterations: int,
    carried_off: int | None = None,
    by: int = 0,
) -> Iterator[tuple[int, int, Any, StepInfo]]:
    """The robot's tile, the one that it believes in, the belief and what the step tells of itself,
    after each iteration.

    carried_off: after this iteration's step the robot is set down so many tiles farther, around the
    row.
    """
    rng = np.random.default_rng(seed)
    tiles = sensor.shape[0]
    x, bel = 0, filter.start(filter.environment, Draws(seed))
    there = believed(filter, bel)
    for k in range(1, iterations + 1):
        action = int(np.sign(tiles // 2 - there))
        x = int(rng.choice(tiles, p=transition(action, tiles)[x]))
        if k == carried_off:
            x = (x + by) % tiles
        z = sensor.sample(np.array([x]), rng)
        bel, info = filter.step(bel, np.array([action]), z, Draws(seed, k))
        there = believed(filter, bel)
        yield x, there, bel, info
