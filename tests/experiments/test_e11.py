"""E11: how its claims are decided, and that its drives hold kidnappings."""

import math

import numpy as np
import pytest

from mcloc.experiments import e11_kidnapped_museum as e11
from mcloc.experiments.study import Verdict
from mcloc.experiments.table import Row, Table
from mcloc.proposals.relocating import Relocating

PLACES = (e11.MUSEUM, "fhw")
USUAL = {e11.MCL: 0.6, e11.WITH_RANDOM: 0.3, e11.PAPERS: 0.1, e11.OURS: 0.02}


def table_of(
    changed: dict[tuple[str, str], float], *, noise: float = 0.1, only: int | None = None
) -> Table:
    """Shares of time lost around USUAL, changed by (place, method), with `only` that many samples;
    noise: how far they scatter, in parts of them.
    """
    rng = np.random.default_rng(0)
    rows = []
    for setting in e11.STUDY.settings():
        place, method = str(setting["place"]), str(setting["method"])
        share = USUAL.get(method, 0.5)
        if only in (None, setting["samples"]):
            share = changed.get((place, method), share)
        rows += [
            Row(setting, seed, {"lost": share * max(0.0, 1.0 + noise * rng.standard_normal())})
            for seed in range(12)
        ]
    return Table(rows)


@pytest.mark.parametrize(
    ("changed", "only", "verdict"),
    [
        ({}, None, Verdict.REPRODUCED),
        ({("fhw", e11.PAPERS): 0.3}, 200, Verdict.REPRODUCED),  # 70 % with the others
        ({("fhw", e11.PAPERS): 0.3}, None, Verdict.IN_PART),  # half, with all
        ({("fhw", e11.PAPERS): 0.7}, 200, Verdict.IN_PART),
        ({("fhw", e11.PAPERS): 0.7}, None, Verdict.IN_PART),
        ({(place, e11.PAPERS): 0.7 for place in PLACES}, None, Verdict.NOT),
    ],
)
def test_as_much_as_70_percent_is_with_some_number_of_samples_at_each_place(
    changed: dict[tuple[str, str], float], only: int | None, verdict: Verdict
) -> None:
    found = e11.STUDY.claims[0].decide(table_of(changed, only=only))
    assert found.verdict is verdict


def test_the_most_is_told_in_percent() -> None:
    table = table_of({("fhw", e11.PAPERS): 0.03}, only=1000)
    found = e11.as_much_as(table, e11.MCL, 0.7)
    assert found.figure.value == pytest.approx(95.0, abs=1.0)
    assert found.figure.low < found.figure.value < found.figure.high
    assert "(fhw, 1,000 samples)" in found.what
    assert "Significantly less in 6 of 6 comparisons, by 70 % or more in 6" in found.note


def test_the_second_claim_is_against_random_samples() -> None:
    as_good = {(place, e11.WITH_RANDOM): 0.1 for place in PLACES}
    second = e11.STUDY.claims[1]
    assert second.decide(table_of({})).verdict is Verdict.REPRODUCED
    assert second.decide(table_of(as_good)).verdict is Verdict.NOT
    assert second.decide(table_of(as_good, only=5000)).verdict is Verdict.IN_PART


@pytest.mark.parametrize(
    ("changed", "only", "verdict"),
    [
        ({}, None, Verdict.REPRODUCED),
        ({("fhw", e11.OURS): 0.1}, 200, Verdict.IN_PART),
        ({(place, e11.OURS): 0.1 for place in PLACES}, None, Verdict.NOT),  # 83 % everywhere
    ],
)
def test_the_ambition_is_for_every_number_of_samples(
    changed: dict[tuple[str, str], float], only: int | None, verdict: Verdict
) -> None:
    found = e11.STUDY.claims[2].decide(table_of(changed, only=only))
    assert found.verdict is verdict
    if only is not None:
        assert "the least (fhw, 200 samples)" in found.what


def test_comparisons_are_corrected_for_each_other() -> None:
    noisy = table_of({(place, e11.PAPERS): 0.4 for place in PLACES}, noise=0.4)
    found = e11.comparisons(noisy, e11.PAPERS, e11.MCL, 0.0)
    one = found[0]
    ours, theirs = (
        noisy.where(place=e11.MUSEUM, samples=200, method=method).column("lost")
        for method in (e11.PAPERS, e11.MCL)
    )
    assert e11.paired_p(ours, theirs) < one.p <= 6 * e11.paired_p(ours, theirs)


def test_where_no_robot_is_lost_nothing_is_less() -> None:
    nobody = table_of({(place, m): 0.0 for place in PLACES for m in e11.METHODS})
    for claim in e11.STUDY.claims:
        found = claim.decide(nobody)
        assert found.verdict is Verdict.NOT
        assert math.isnan(found.figure.value)


def test_all_methods_have_the_same_number_of_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e11, "LENGTH", 20.0)
    driven, _ = e11.kidnapped(e11.MUSEUM, 0)
    sizes = {}
    for method in e11.METHODS:
        history = e11.localized(
            driven, e11.composition(method, 300), 0, initial=driven.truth.poses[0]
        )
        sizes[method] = set(history.updates.table[:, 2])
    e11.kidnapped.cache_clear()
    assert all(300.0 in n for n in sizes.values())
    assert all(n == {300.0} for method, n in sizes.items() if method != e11.RESETTING)


def test_ours_is_the_default_mixture() -> None:
    driven, _ = e11.kidnapped(e11.MUSEUM, 0)
    ours = e11.composition(e11.OURS, 300)
    (part,) = ours.build(driven.grid).parts
    assert isinstance(part.proposal, Relocating)
    assert ours.recovery == "augmented"
    assert "recovery" not in ours.settings


def test_a_run_holds_kidnappings_and_a_seed_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(e11, "LENGTH", 30.0)
    monkeypatch.setattr(e11, "PER_METRE", 0.1)
    e11.kidnapped.cache_clear()
    setting = {"place": e11.MUSEUM, "samples": 200, "method": e11.PAPERS}
    one, again = (e11.run(setting, 1) for _ in range(2))
    e11.kidnapped.cache_clear()
    assert one["kidnapped"] > 0
    assert 0.0 < one["lost"] < 1.0
    assert {k: v for k, v in one.items() if k != "update_ms"} == {
        k: v for k, v in again.items() if k != "update_ms"
    }
