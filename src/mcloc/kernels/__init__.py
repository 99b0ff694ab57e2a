"""Compiled loops: the only place that imports Numba. Flat arrays in, flat arrays out."""
