"""Robots that see each other, and localize together  [Fox, Burgard, Kruppa, Thrun 2000]."""
