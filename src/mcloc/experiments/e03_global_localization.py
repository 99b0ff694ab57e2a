"""E3: global localization, from everywhere to one place  [Fox01 §19.2.4, Fig. 19.4; Fox99 "A
Graphical Example", Fig. 2–4].
"""

import math

import numpy as np

from mcloc.evaluation.intervals import LEVEL, proportion
from mcloc.experiments.global_picture import draw
from mcloc.experiments.global_runs import (
    FACTORS,
    LASER,
    OFTEN,
    REACH,
    RING,
    SONARS,
    SYMMETRIC,
    applies,
    changes,
    run,
    settings,
    share,
    told,
)
from mcloc.experiments.places import files, missing
from mcloc.experiments.study import Claim, Finding, Study, Verdict
from mcloc.experiments.table import Table

ABOUT = f"""
A robot that knows the map and nothing of its place drives a few metres with sonars, as the paper's,
for each seed elsewhere: 10,000 samples are spread over the free floor, and looked at after 1 m and
3 m of its true path (at the first scan from there on; those of *intel* are 1 m apart).

- *generated office*: another floor with 266 m² free, and another start, for each seed.
  *freiburg-079*, *intel*, *wean-1*: recorded logs with 915, 824 and 483 m² of free floor, started
  at any moment that leaves 10 m to drive. *symmetric office*: a control, a floor that is the same
  after half a turn, so that nothing which the robot sees tells the two places apart.
- *sonar*: a simulated ring of {SONARS}, the most that the papers' robots have,
  {math.degrees(RING.cone):.0f}° wide, up to {REACH:g} m; {100.0 * RING.sigma_relative:g} % noise,
  {100.0 * RING.missing:g} % of the echoes are lost, {100.0 * RING.crosstalk:g} % are of other
  sonars. The recorded logs have lasers, no sonars. Theirs is *derived sonar*: the nearest return of
  the laser in each cone of the same ring. It looks half around, as the lasers do: 10 of {SONARS}
  remain. It is more precise than real sonars: no wall mirrors, and nobody else is heard.
- *laser*: the scans themselves, 180° wide; it was here before the sonars. No claim is decided
  by it.
- Sensor models (`sonar`, ranges looked up; `likelihood-field`), motion model and environment are
  mcloc's defaults. The paper's filter has no doubt in the wheels, so that is off. Each scan is
  used, and counts in full, as in the paper: as 12 independent readings, derived sonars as 10.
- What the paper leaves open is changed one at a time. It tells 10,000 samples but not how large its
  building was, and it is samples per square metre that decide whether one is near the truth: so
  100,000 are tried too. Fox99 adds "a small number" of random samples, but does not say whether
  this example had them: *random* = 0.02 of them are tried. With *scans* = "decorrelated" mcloc's
  default takes the place of every scan: an update each 0.2 m, in which a scan counts in proportion
  to the way since the last one.
- A *place* is a hypothesis with 5 % of the belief or more whose samples scatter by less than 2 m
  (the uniform belief is one hill, and no place); hypotheses within 1 m and 20° of a larger one
  belong to it. The true place is one within 1 m and 20° of the truth.
- *Few* after 1 m: at most two places, which hold 90 % of the belief, one of them the true one.
  *Found* after 3 m: one place holds 95 %, and it is the true one. The paper shows "a typical
  example", so a claim holds where more than half of the runs are so.
"""


def typical(table: Table, metric: str, what: str) -> Finding:
    """With sonars more than half of the runs are so, at every place, as in the paper."""
    sonar = [
        (s, rows) for s, rows in settings(table) if s["place"] != SYMMETRIC and s["sensor"] != LASER
    ]
    own = [(s, share(rows, metric)) for s, rows in sonar if not changes(s)]
    level = 1.0 - (1.0 - LEVEL) / len(sonar)
    holds = [told(s) for s, rows in sonar if share(rows, metric, level).low > OFTEN]
    if all(figure.low > OFTEN for _, figure in own):
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.IN_PART if holds else Verdict.NOT
    setting, figure = min(own, key=lambda one: one[1].value)
    note = (
        f"{'; '.join(f'{told(s)}: {found}' for s, found in own)}. So with sonars in more than half "
        f"of the runs: {'; '.join(holds) or 'nowhere'}."
    )
    return Finding(verdict, f"{what}, the least ({told(setting)})", figure, note)


def uniform(table: Table) -> Finding:
    """No place before the first scan."""
    none = int(np.count_nonzero(table.column("places_0") == 0))
    figure = proportion(none, len(table.column("places_0")))
    verdict = Verdict.REPRODUCED if figure.value == 1.0 else Verdict.NOT
    return Finding(verdict, "share of the runs that start without any place", figure)


def few(table: Table) -> Finding:
    """At most two places are left, one of them the true one."""
    return typical(table, "few_1", "share of the runs with few places after 1 m")


def found(table: Table) -> Finding:
    """One place is left, the true one."""
    return typical(table, "found_3", "share of the runs in which the place is found after 3 m")


def symmetric(table: Table) -> Finding:
    """Two places that look the same remain two."""
    shares = [(s, share(rows, "unique_3")) for s, rows in settings(table.where(place=SYMMETRIC))]
    sonar = [(s, figure) for s, figure in shares if s["sensor"] != LASER]
    holds = [figure.high < OFTEN for _, figure in sonar]
    setting, figure = max(sonar, key=lambda one: one[1].value)
    note = "; ".join(f"{told(s)}: {f}" for s, f in shares)
    return Finding(
        Verdict.REPRODUCED if all(holds) else Verdict.IN_PART if any(holds) else Verdict.NOT,
        f"share of the runs in which only one place is left after 3 m, the most ({told(setting)})",
        figure,
        f"{note}.",
    )


STUDY = Study(
    number="E3",
    title="Global localization: from everywhere to one place",
    source="Fox01 §19.2.4 and Fig. 19.4; Fox99 Fig. 2–4",
    about=ABOUT,
    factors=FACTORS,
    run=run,
    metrics={
        "places_1": "places after 1 m",
        "best_1": "share of the largest",
        "few_1": "few after 1 m",
        "places_3": "places after 3 m",
        "best_3": "share of the largest one",
        "unique_3": "only one after 3 m",
        "found_3": "found after 3 m",
    },
    claims=(
        Claim(
            "At first the samples are spread uniformly through the free space",
            "a picture of the samples",
            "holds, they are drawn so. Reproduced: no run starts with a place",
            uniform,
        ),
        Claim(
            "After about 1 m of motion the place is known up to a single symmetry",
            "two clusters of samples",
            "not everywhere. In a cone the nearest wall is the same for some 8° around, so a scan "
            "of sonars fits within some 0.3 m and 8° of the truth, which is 1 in 20,000 poses of "
            "the office and 1 in 70,000 of freiburg-079, three times as many as with a laser. With "
            "10,000 samples that is about half of the runs in the office, and fewer in the "
            "logs, where derived sonars look half around. With 100,000 it should hold in the "
            "office. Reproduced: at every place, with sonars as in the paper, the exact 95 % "
            "interval of the share of runs with few places lies above 0.5; in part: in some "
            "setting with sonars, by intervals that hold for all of these at once (Bonferroni)",
            few,
        ),
        Claim(
            "After another 2 m the place is unique, and it is the true one",
            "one tight cluster at the true place",
            "as before: in the office with 100,000 samples. A place that no sample holds can only "
            "be found later by random ones; 2 % of them on 3 m are about as many as there were "
            "samples in the beginning, so they should help a little. Reproduced: at every place, "
            "with sonars as in the paper, the exact 95 % interval of the share of runs in which it "
            "is found lies above 0.5; in part: in some setting with sonars (Bonferroni)",
            found,
        ),
        Claim(
            "A symmetry that nothing resolves remains",
            "none; a control",
            "not with samples, though of the exact belief both places have a half each: those that "
            "happen to be nearest to one of them outweigh those at the other, the more so the more "
            "each scan counts. With a laser, which was tried first, one place was left in nearly "
            "all runs; sonars tell places apart less sharply, and scans that are decorrelated "
            "count less, so there more than one should be left most often. Reproduced: the exact "
            "95 % interval of the share of runs with only one place after 3 m lies below 0.5 in "
            "every setting with sonars; in part: in some",
            symmetric,
        ),
    ),
    draw=draw,
    seeds=60,
    applies=applies,
    missing=missing,
    inputs=files,
)
