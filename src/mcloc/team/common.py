"""Fingerprints of what the robots of a team should have in common, for each to tell the others."""

import hashlib

from mcloc.localizer import Localizer
from mcloc.maps.landmarks import Landmarks
from mcloc.registry import parameters
from mcloc.team.detection import DetectionModel
from mcloc.team.letters import Common

OF_ONE = {"particles", "p_detect", "fov"}  # of the model: effort, and what is not told by letters


def common_of(localizer: Localizer, model: DetectionModel) -> Common:
    """Those of one robot."""
    shared = {f.name: getattr(model, f.name) for f in parameters(model) if f.name not in OF_ONE}
    landmarks = [aid.checksum for aid in localizer.aids if isinstance(aid, Landmarks)]
    return Common(
        _short(repr(sorted(shared.items()))),
        _short(localizer.grid.checksum),
        _short("".join(landmarks)) if landmarks else 0,
    )


def _short(told: str) -> int:
    """8 bytes of it, never 0."""
    return int.from_bytes(hashlib.sha256(told.encode()).digest()[:8], "little") or 1
