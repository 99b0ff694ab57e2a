"""The runtime that a user drives: events in, in order of time; estimates out."""

from mcloc.localizer.estimate import Estimate, Update
from mcloc.localizer.localizer import Localizer
from mcloc.localizer.policy import UpdatePolicy

__all__ = ["Estimate", "Localizer", "Update", "UpdatePolicy"]
