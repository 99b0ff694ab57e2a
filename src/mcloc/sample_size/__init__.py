"""How many particles: fixed, or found while drawing."""

from mcloc.protocols import SampleSize
from mcloc.registry import Registry
from mcloc.sample_size.fixed import Fixed
from mcloc.sample_size.kld import KLD
from mcloc.sample_size.likelihood_sum import LikelihoodSum
from mcloc.sample_size.recorded import Recorded, sizes_csv
from mcloc.sample_size.time_budget import TimeBudget

__all__ = ["KLD", "SIZES", "Fixed", "LikelihoodSum", "Recorded", "TimeBudget", "sizes_csv"]

SIZES: Registry[SampleSize] = Registry(
    "size",
    {
        "fixed": Fixed,
        "kld": KLD,
        "likelihood-sum": LikelihoodSum,
        "time-budget": TimeBudget,
        "recorded": Recorded,
    },
)
