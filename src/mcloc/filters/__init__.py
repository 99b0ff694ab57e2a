"""Filters as compositions of parts: the particle filter, its recovery, the catalog."""
