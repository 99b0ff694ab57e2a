"""Monte Carlo localization of mobile robots in Python."""

__version__ = "0.1.0"
