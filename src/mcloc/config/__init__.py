"""A run described by names and values, from YAML and from the command line, and back to YAML."""

from mcloc.config.entries import checked, limited, merged, read_entries
from mcloc.config.run_config import CHOICES, RunConfig

__all__ = ["CHOICES", "RunConfig", "checked", "limited", "merged", "read_entries"]
