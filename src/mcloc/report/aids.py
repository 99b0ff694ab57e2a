"""What a place has for sensors besides walls, and what is recorded of it beside the log."""

from typing import Any

from mcloc.config import RunConfig
from mcloc.events import Log
from mcloc.io.beacons import read_beacon_ranges, without_scans
from mcloc.io.images import ImageFolder
from mcloc.io.log import changed
from mcloc.io.mrclam import Mrclam, is_mrclam
from mcloc.maps.beacons import Beacons, read_beacons
from mcloc.maps.mosaic import Mosaic
from mcloc.simulation.derived_sonar import CONE, DerivedSonar


def aids_of(config: RunConfig) -> tuple[Any, ...]:
    """The maps of them, as `Composition.build` wants them. Raises MapError."""
    aids: list[Any] = []
    if is_mrclam(config.log):
        aids.append(Mrclam(config.log, config.robot).landmarks)
    if config.beacons is not None:
        aids.append(read_beacons(config.beacons))
    if config.ceiling is not None:
        aids.append(Mosaic.load(config.ceiling))
    return tuple(aids)


def measured_log(log: Log, config: RunConfig, aids: tuple[Any, ...]) -> Log:
    """The log with what was recorded beside it, and without its scans where these are not to be
    used. Raises LogError.
    """
    for aid in aids:
        if isinstance(aid, Beacons) and config.beacon_ranges is not None:
            log = changed(log, read_beacon_ranges(config.beacon_ranges, aid).among)
    if config.images is not None:
        log = changed(log, ImageFolder.opened(config.images).among)
    if config.derive_sonar is not None:
        cone = float(config.settings["sensor"].get("cone", 0.0)) or CONE
        log = changed(log, DerivedSonar(config.derive_sonar, cone).instead)
    return log if config.scans else changed(log, without_scans)
