"""How good a trajectory is: errors against a reference, convergence, recovery, consistency."""

from mcloc.evaluation.accuracy import Accuracy, evaluate
from mcloc.evaluation.convergence import Recovery

__all__ = ["Accuracy", "Recovery", "evaluate"]
