"""The runtime that a user drives: events in, in order of time; estimates out."""

import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcloc.density import Gaussian
from mcloc.draws import Draws
from mcloc.errors import ConfigError
from mcloc.estimate import Hypothesis, hypotheses
from mcloc.events import Event, Odometry, Scan
from mcloc.filters.catalog import Composition
from mcloc.filters.particle_filter import Belief
from mcloc.geometry import Pose, between, compose, interpolate, wrap
from mcloc.maps.occupancy import OccupancyGrid


@dataclass(frozen=True, eq=False, slots=True)
class Estimate:
    t: float
    hypotheses: tuple[Hypothesis, ...]
    n_particles: int
    ess: float
    likelihood_fast: float
    likelihood_slow: float
    explained: float
    updated: bool
    update_ms: float

    @property
    def pose(self): return self.hypotheses[0].mean


class Localizer:
    def __init__(self, grid, composition=Composition(), *, seed=0, initial=None, update_distance=0.2, update_angle=0.2):
        self.grid=grid; self.filter=composition.build(grid); self.seed=seed
        self.d,self.a=update_distance,update_angle
        self.step=0
        if initial is None: initial=self.filter.uniform
        self.bel=self.filter.start(initial, Draws(seed,0))
        self.at=None
        self.ignored=Counter()

    def run(self, events):
        for e in events:
            if isinstance(e, Scan):
                yield self.process(e)

    def process(self, z):
        odom=z.odometry
        u=np.zeros(3) if self.at is None else between(self.at,odom)
        if self.at is None or np.hypot(u[0],u[1])>=self.d or abs(u[2])>=self.a:
            t0=time.perf_counter()
            self.step+=1
            self.bel,info=self.filter.step(self.bel,u,z,Draws(self.seed,self.step))
            self.hyp=hypotheses(self.bel.particles,self.filter.space)
            self.info=info
            self.at=odom
            self.ms=(time.perf_counter()-t0)*1e3
            self.ex=float(self.filter.sensor.explained(self.hyp[0].mean[:,None],z)[0])
            u=np.zeros(3); upd=True
        else: upd=False
        hyp=tuple(replace(h,mean=compose(h.mean,u)) for h in self.hyp)
        return Estimate(z.t,hyp,self.info.n,self.info.ess,self.bel.evidence.fast,self.bel.evidence.slow,self.ex,upd,self.ms)
