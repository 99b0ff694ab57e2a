"""Hierarchical Monte Carlo localization  [Est]."""
