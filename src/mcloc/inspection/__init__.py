"""What is in a map or a log, and what looks wrong in them, alone and together."""

from mcloc.inspection.finding import Finding
from mcloc.inspection.fit import Fit, inspect_fit
from mcloc.inspection.log_inspection import LogInspection, describe_log, describe_stream
from mcloc.inspection.map_checks import describe_map, inspect_map

__all__ = [
    "Finding",
    "Fit",
    "LogInspection",
    "describe_log",
    "describe_map",
    "describe_stream",
    "inspect_fit",
    "inspect_map",
]
