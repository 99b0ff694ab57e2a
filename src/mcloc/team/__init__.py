"""Robots that localize each other: what one that sees another tells it, and is told by it."""
