"""What a run found out about its radio beacons."""

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from mcloc.events import BeaconRanges
from mcloc.maps.beacons import Beacons
from mcloc.report.run import Run
from mcloc.sensors.beacons import BeaconModel
from mcloc.sensors.fused import Fused

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRUSTED, DISTRUSTED = "#e08a1e", "#c0392b"
BAD = 0.5  # trust; less is drawn in another colour


def found_out(run: Run) -> dict[str, dict[str, Any]] | None:
    """By beacon: how many readings were news, the share of them that the beacon's place explained,
    and how much one counts, 0 … 1. None for a run without beacons.
    """
    beacons = next((aid for aid in run.aids if isinstance(aid, Beacons)), None)
    if beacons is None:
        return None
    count = len(beacons.names)
    z = run.localizer.told(BeaconRanges(0.0, np.arange(count), np.zeros(count)))
    assert isinstance(z, BeaconRanges)
    model = cast(BeaconModel, cast(Fused, run.localizer.filter.sensor).of(z))
    trust = model.trust(z)
    return {
        name: {
            "readings": float(heard),
            "explained": float(1.0 - failed / heard) if heard > 0.0 else None,
            "trust": float(t),
        }
        for name, heard, failed, t in zip(beacons.names, z.heard, z.failed, trust, strict=True)
    }


def draw_beacons(axes: "Axes", run: Run) -> list[NDArray[np.float64]]:
    """A triangle for each beacon, with its name, those that are hardly trusted in red; where they
    are, (L, 2), for each map of beacons.
    """
    maps = [aid for aid in run.aids if isinstance(aid, Beacons)]
    known = found_out(run) or {}
    for aid in maps:
        for bad, colour in ((False, TRUSTED), (True, DISTRUSTED)):
            some = [k for k, name in enumerate(aid.names) if (known[name]["trust"] < BAD) == bad]
            if not some:
                continue
            label = "beacons that err too often" if bad else "beacons"
            x, y, _ = aid.places[some].T
            axes.plot(x, y, "^", color=colour, ms=9, mec="white", zorder=5, label=label)
            for k in some:
                axes.annotate(
                    aid.names[k],
                    (aid.places[k, 0], aid.places[k, 1]),
                    (6, 4),
                    textcoords="offset points",
                    color=colour,
                    zorder=5,
                )
    return [aid.places[:, :2] for aid in maps]
