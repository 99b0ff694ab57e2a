"""Recorded logs and trajectories: each reader yields the same events."""
