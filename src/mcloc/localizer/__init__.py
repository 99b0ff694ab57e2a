"""The runtime that a user drives: events in, in order of time; estimates out."""

from mcloc.localizer.estimate import Estimate, Update
from mcloc.localizer.localizer import Localizer
from mcloc.localizer.pace import PACES, Measured, Modelled, Offline, Pace
from mcloc.localizer.policy import UpdatePolicy

__all__ = [
    "PACES",
    "Estimate",
    "Localizer",
    "Measured",
    "Modelled",
    "Offline",
    "Pace",
    "Update",
    "UpdatePolicy",
]
