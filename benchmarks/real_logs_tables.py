"""The tables of real_logs.py, from the rows of its runs."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from mcloc.evaluation.intervals import paired_difference, paired_ratio, proportion
from mcloc.evaluation.survival import Survival

Rows = list[dict[str, Any]]
MARGIN = 0.01  # m
WITHIN = 20.0  # m


def tables(rows: Rows) -> Iterator[str]:
    """The report, line by line."""
    yield "    MCLOC_DATA=… python benchmarks/real_logs.py\n"
    yield "Seeds are fixed: the same command gives the same tables, but for the speed.\n"
    yield from tracking([row for row in rows if row["study"] == "tracking"])
    yield from beside_mcl([row for row in rows if row["study"] == "tracking"])
    yield from global_start([row for row in rows if row["study"] == "global"])
    yield from kidnapped([row for row in rows if row["study"] == "kidnapped"])


def of(rows: Rows, **wanted: str) -> Rows:
    """Those with these values."""
    return [row for row in rows if all(row[k] == v for k, v in wanted.items())]


def names(rows: Rows, column: str) -> list[str]:
    """Each value once, in order."""
    return list(dict.fromkeys(row[column] for row in rows))


def rate(successes: int, n: int) -> str:
    """k/n with its exact 95 % interval."""
    interval = proportion(successes, n)
    return f"{successes}/{n} ({100 * interval.low:.0f}–{100 * interval.high:.0f} %)"


def spread(values: list[float], digits: int) -> str:
    """median (smallest–largest)."""
    if not values:
        return "–"
    return f"{np.median(values):.{digits}f} ({min(values):.{digits}f}–{max(values):.{digits}f})"


def tracking(rows: Rows) -> Iterator[str]:
    yield "## Tracking from the reference start (σ 0.5 m, 15°)\n"
    seeds = len({row["seed"] for row in rows})
    yield f"The default filter, {seeds} seeds; median (smallest–largest) over the seeds.\n"
    yield (
        "| log | position median, m | RMSE, m | worst error, m | heading median, ° "
        "| NEES median | runs ever > 1 m off | real time × |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for log in names(rows, "log"):
        some = of(rows, log=log, method="mixture")
        a = [row["accuracy"] for row in some]
        yield (
            f"| {log} | {spread([x['position_median_m'] for x in a], 3)} "
            f"| {spread([x['position_rmse_m'] for x in a], 3)} "
            f"| {max(x['position_max_m'] for x in a):.2f} "
            f"| {spread([x['heading_median_deg'] for x in a], 2)} "
            f"| {spread([x['nees_median'] for x in a if x['nees_median'] is not None], 1)} "
            f"| {rate(sum(x['position_max_m'] > 1.0 for x in a), len(a))} "
            f"| {np.median([row['realtime'] for row in some]):.0f} |"
        )


def beside_mcl(rows: Rows) -> Iterator[str]:
    yield "\n## Tracking: the mixture beside MCL\n"
    yield (
        "The same seeds. Difference: the mean, over seeds, of the mixture's median error less that "
        f"of MCL; not worse where its upper limit is below {MARGIN:g} m. While nothing makes it "
        "search the mixture does what MCL does, to the last bit. Update: the time of a median "
        "update, and of a mean one, in those of MCL.\n"
    )
    yield (
        "| log | MCL, position median, m | difference, mm | not worse | MCL ever > 1 m off "
        "| update, median | mean |"
    )
    yield "|---|---|---|---|---|---|---|"
    for log in names(rows, "log"):
        ours, mcl = (of(rows, log=log, method=method) for method in ("mixture", "MCL"))
        position = [[row["accuracy"]["position_median_m"] for row in some] for some in (ours, mcl)]
        difference = paired_difference(*position)
        times = [
            paired_ratio([row[name] for row in ours], [row[name] for row in mcl]).value
            for name in ("update_ms", "mean_ms")
        ]
        off = sum(row["accuracy"]["position_max_m"] > 1.0 for row in mcl)
        yield (
            f"| {log} | {spread(position[1], 3)} | {1e3 * difference.value:.1f} "
            f"({1e3 * difference.low:.1f} to {1e3 * difference.high:.1f}) "
            f"| {'yes' if difference.high < MARGIN else 'no'} | {off}/{len(mcl)} "
            f"| {times[0]:.2f} × | {times[1]:.2f} × |"
        )


def global_start(rows: Rows) -> Iterator[str]:
    yield "\n## Global localization\n"
    starts = len({row["start"] for row in of(rows, log=rows[0]["log"])})
    seeds = len({row["seed"] for row in rows})
    yield (
        f"{starts} start times with ≥ 15 m left × {seeds} seeds; the mixture with at most 5,000 "
        "particles, MCL with at most 20,000. Converged: errors below 0.5 m and 10° until the end. "
        "Found: the same for 3 m, whatever comes later.\n"
    )
    yield (
        "| log | filter | converged | found after, m: 25 / 50 / 75 / 90 / 100 % of all runs "
        "| by start time |"
    )
    yield "|---|---|---|---|---|"
    for log in names(rows, "log"):
        for method in names(rows, "method"):
            some = of(rows, log=log, method=method)
            good = [row["accuracy"]["converged"] for row in some]
            after = [first[1] if first[2] else np.inf for first in _firsts(some)]
            quantiles = " / ".join(
                f"{q:.1f}" if np.isfinite(q) else "–"
                for q in np.quantile(after, [0.25, 0.5, 0.75, 0.9, 1.0], method="higher")
            )
            by_start = [sum(good[i : i + seeds]) for i in range(0, len(good), seeds)]
            yield (
                f"| {log} | {method} | {rate(sum(good), len(good))} | {quantiles} "
                f"| {' '.join(map(str, by_start))} |"
            )


def _firsts(rows: Rows) -> list[list[Any]]:
    return [row["first"] for row in rows]


def kidnapped(rows: Rows) -> Iterator[str]:
    yield "\n## Kidnapping\n"
    seeds = len({row["seed"] for row in rows})
    yield (
        f"Tracking from the true start until the robot is carried off; {seeds} seeds. In "
        "robotdata_1then4 that happens once; in the others with p = 0.01 per metre of true path, "
        "to anywhere else in the log. Stretches of ≥ 15 m. Found: errors below 0.5 m and 10° for "
        "3 m. Share within 20 m: 1 − Kaplan–Meier, with its lower limit. Stays: the same share "
        "where errors have to stay small until the stretch ends; the references of freiburg-079 "
        "jump by up to 33° in some places, which no estimate follows.\n"
    )
    yield (
        "| log | method | stretches | found within 20 m | median, m | mean of the first 20 m "
        "| stays, within 20 m | time > 2 m off, % |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for log in names(rows, "log"):
        for method in names(rows, "method"):
            some = of(rows, log=log, method=method)
            seen, stays = (
                survival_of([s for row in some for s in row[name]]) for name in ("found", "stays")
            )
            median = "–" if seen.median is None else f"{seen.median:.1f}"
            lost = 100.0 * np.mean([row["lost"] for row in some])
            yield (
                f"| {log} | {method} | {len(seen)} | {_within(seen)} | {median} "
                f"| {seen.restricted_mean(WITHIN):.1f} | {_within(stays)} | {lost:.1f} |"
            )
    yield "\nAll four logs together:\n"
    yield "| method | stretches | found within 20 m | median, m | mean of the first 20 m |"
    yield "|---|---|---|---|---|"
    for method in names(rows, "method"):
        seen = survival_of([s for row in of(rows, method=method) for s in row["found"]])
        median = "–" if seen.median is None else f"{seen.median:.1f}"
        yield (
            f"| {method} | {len(seen)} | {_within(seen)} | {median} "
            f"| {seen.restricted_mean(WITHIN):.1f} |"
        )


def survival_of(stretches: list[list[Any]]) -> Survival:
    """Of [metres to drive, metres until found, whether found], those that are long enough."""
    long = [s for s in stretches if s[0] >= 15.0]
    return Survival(
        np.array([s[1] if s[2] else s[0] for s in long]), np.array([s[2] for s in long])
    )


def _within(survival: Survival) -> str:
    share = survival.within(WITHIN)
    return f"{100 * share.value:.0f} % (≥ {100 * share.low:.0f} %)"
