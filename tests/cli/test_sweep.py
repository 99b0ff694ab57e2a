"""`mcloc sweep` on a short drive: the runs are those of `mcloc run`."""

import csv
import gzip
import json
from pathlib import Path

import pytest

from .conftest import Mcloc


@pytest.fixture
def files(drive: Path) -> list[object]:
    return [
        *("--map", drive / "map.yaml", "--log", drive / "log.gz"),
        *("--truth", drive / "truth.csv"),
    ]


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_combination_is_run_with_every_seed(
    mcloc: Mcloc, files: list[object], tmp_path: Path
) -> None:
    done = mcloc(
        *("sweep", *files, "--vary", "sensor.sigma_hit=0.05,0.2", "--vary", "particles=300,1e3"),
        *("--set", "size.minimum=100", "--seeds", 2, "--jobs", 1, "--out", tmp_path),
    )
    assert (done.code, done.stderr) == (0, "")
    rows = rows_of(tmp_path)
    assert [(r["sensor.sigma_hit"], r["particles"], r["seed"]) for r in rows] == [
        (sigma, n, seed) for sigma in ("0.05", "0.2") for n in ("300", "1000") for seed in "01"
    ]
    assert all(r["error"] == "" and 0.0 < float(r["position_m"]) < 0.5 for r in rows)
    assert "median position error, m" in done.stdout
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert "Tracked from the true start" in (tmp_path / "study.md").read_text(encoding="utf-8")


def test_a_run_of_a_sweep_is_a_run(
    mcloc: Mcloc, files: list[object], start: str, tmp_path: Path
) -> None:
    """The same accuracy as by `mcloc run` with the same seed, settings and start."""
    run = mcloc(
        *("run", *files, "--initial", start, "--seed", 1, "--set", "sensor.sigma_hit=0.2"),
        *("--out", tmp_path / "run", "--no-plot", "--json"),
    )
    accuracy = json.loads(run.stdout)["accuracy"]
    out = tmp_path / "sweep"
    mcloc(
        *("sweep", *files, "--vary", "sensor.sigma_hit=0.2", "--seeds", 2, "--jobs", 1),
        *("--out", out),
    )
    row = rows_of(out)[1]
    # The start is written in degrees on the one command line: not to the last bit the same.
    assert float(row["position_m"]) == pytest.approx(accuracy["position_median_m"], rel=0.02)
    assert float(row["rmse_m"]) == pytest.approx(accuracy["position_rmse_m"], rel=0.02)


def test_starts_search_from_several_moments(
    mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    folder = tmp_path_factory.mktemp("longer")
    mcloc("simulate", "--length", 22, "--seed", 1, "--format", "carmen", "--out", folder)
    done = mcloc(
        *("sweep", "--map", folder / "map.yaml", "--log", folder / "log.gz"),
        *("--truth", folder / "truth.csv", "--vary", "recovery=none,augmented"),
        *("--starts", 3, "--seeds", 1, "--jobs", 1, "--json", "--out", tmp_path),
    )
    assert done.code == 0
    told = json.loads(done.stdout)
    assert [row["setting"] for row in told] == [{"recovery": "none"}, {"recovery": "augmented"}]
    assert all(row["runs"] == 3 and 0.0 <= row["converged"]["value"] <= 1.0 for row in told)
    assert all(row["converged"]["known_of"] == 3 for row in told)
    assert [row["start"] for row in rows_of(tmp_path)] == ["0", "1", "2"] * 2


def test_filters_that_need_a_start_or_a_real_map_can_be_varied(
    mcloc: Mcloc, files: list[object], tmp_path: Path
) -> None:
    """A Kalman filter does not search, and no robot has a place on a map of a square metre."""
    done = mcloc(
        *("sweep", *files, "--vary", "filter=kalman,topological,grid-proposal"),
        *("--seeds", 1, "--jobs", 1, "--out", tmp_path / "out"),
    )
    assert done.code == 0, done.stderr
    rows = rows_of(tmp_path / "out")
    assert [row["filter"] for row in rows] == ["kalman", "topological", "grid-proposal"]
    assert [row["error"] for row in rows] == ["", "", ""]
    assert [float(row["withheld"]) for row in rows] == [0.0, 0.0, 0.0]


def test_what_only_the_real_map_or_start_shows_is_told_before_anything_is_run(
    mcloc: Mcloc, files: list[object], tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    """A grid that is too large for this map, and a search with a filter that cannot."""
    large = mcloc(
        *("sweep", *files, "--vary", "filter=markov-grid", "--vary", "filter.memory=4000,30"),
        *("--out", tmp_path / "out"),
    )
    assert large.code == 2
    assert "more than filter.memory = 30 MB" in large.stderr
    folder = tmp_path_factory.mktemp("longer")
    mcloc("simulate", "--length", 22, "--seed", 1, "--format", "carmen", "--out", folder)
    lost = mcloc(
        *("sweep", "--map", folder / "map.yaml", "--log", folder / "log.gz"),
        *("--truth", folder / "truth.csv", "--vary", "filter=mixture,kalman"),
        *("--starts", 2, "--out", tmp_path / "out"),
    )
    assert lost.code == 2
    assert lost.stderr.startswith("error: a Kalman filter follows one Gaussian and cannot search")
    assert not (tmp_path / "out").exists()


def test_teleports_tell_how_soon_the_robot_is_found(
    mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    folder = tmp_path_factory.mktemp("longer")
    mcloc("simulate", "--length", 80, "--seed", 1, "--format", "carmen", "--out", folder)
    done = mcloc(
        *("sweep", "--map", folder / "map.yaml", "--log", folder / "log.gz"),
        *("--truth", folder / "truth.csv", "--vary", "recovery=augmented"),
        *("--teleports", 0.03, "--seeds", 2, "--jobs", 1, "--json", "--out", tmp_path),
    )
    assert done.code == 0
    (told,) = json.loads(done.stdout)
    rows = rows_of(tmp_path)
    carried_off = [len(json.loads(row["recoveries"])) for row in rows]
    assert sum(carried_off) > 0
    assert told["found within 20 m"] != "–"
    assert "carried off with p = 0.03 per metre" in (tmp_path / "study.md").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "what is to be varied? Give --vary sensor.sigma_hit=0.05,0.1,0.2"),
        (["--vary", "sensor.sigma_hit"], "--vary takes name=value,value,..., such as"),
        (["--vary", "sensor.sigma_hit=0.1,,2"], "--vary takes name=value,value,..., such as"),
        (["--vary", "sensor.sigma_hit=0.1,0.1"], "--vary sensor.sigma_hit: a value is given twice"),
        (["--vary", "sensor.sigma_hot=1,2"], "sensor 'likelihood-field' has no parameter"),
        (["--vary", "sensor.sigma_hit=0.1,-3"], "sensor.sigma_hit = -3.0 m must be >= 0.001"),
        (["--vary", "sensor=lidar"], "unknown sensor 'lidar'"),
        (["--vary", "wheels.a=1"], "unknown part 'wheels'"),
        (["--vary", "wheels=1"], "--vary: unknown name 'wheels'"),
        (["--vary", "particles=0,5"], "a filter needs at least one particle, got 0"),
        (["--vary", "particles=many"], "--vary particles: a whole number, got 'many'"),
        (["--vary", "seed=1,2"], "--vary: unknown name 'seed'"),
        (["--vary", "pace=offline", "--starts", "99", "--teleports", "0.1"], "--starts and"),
        (["--vary", "pace=offline", "--teleports", "1.5"], "--teleports is a chance per metre"),
        (
            ["--vary", "pace=offline", "--starts", "2"],
            "--starts 2: the truth is 14.3 m long, and 0 of its",
        ),
    ],
)
def test_wrong_input_is_told_before_anything_is_run(
    mcloc: Mcloc, files: list[object], tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = mcloc("sweep", *files, *arguments, "--out", tmp_path / "out")
    assert done.code == 2
    assert done.stderr.startswith(f"error: {message}")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_sweep_needs_a_truth_and_a_log(mcloc: Mcloc, drive: Path, tmp_path: Path) -> None:
    vary = ("--vary", "sensor.sigma_hit=0.1", "--out", tmp_path / "out")
    done = mcloc("sweep", "--map", drive / "map.yaml", "--log", drive / "log.gz", *vary)
    assert (done.code, done.stderr) == (
        2,
        "error: which truth? A sweep compares with one: give --truth FILE\n",
    )
    assert mcloc("sweep", *vary).stderr.startswith("error: which log?")


def test_missing_files_are_told_before_anything_is_run(
    mcloc: Mcloc, drive: Path, tmp_path: Path
) -> None:
    files = {"map": drive / "map.yaml", "log": drive / "log.gz", "truth": drive / "truth.csv"}
    for name in files:
        given = {**files, name: drive / "nothing"}
        arguments = [word for role, path in given.items() for word in (f"--{role}", path)]
        done = mcloc(
            "sweep", *arguments, "--vary", "sensor.sigma_hit=0.1", "--out", tmp_path / "out"
        )
        assert done.code == 2
        assert f"{drive / 'nothing'}" in done.stderr
        assert not (tmp_path / "out").exists()


def test_what_is_set_holds_also_where_parts_are_varied(
    mcloc: Mcloc, files: list[object], tmp_path: Path
) -> None:
    mcloc(
        *("sweep", *files, "--vary", "size=fixed", "--set", "size.particles=70", "--seeds", 1),
        *("--jobs", 1, "--out", tmp_path),
    )
    assert [row["drawn"] for row in rows_of(tmp_path)] == ["70.0"]


def test_the_start_is_that_of_the_log_where_the_truth_begins_before(
    mcloc: Mcloc, drive: Path, tmp_path: Path
) -> None:
    with gzip.open(drive / "log.gz", "rt") as file:
        lines = file.readlines()
    later = tmp_path / "later.log.gz"
    with gzip.open(later, "wt") as file:
        file.writelines(lines[int(0.4 * len(lines)) :])
    mcloc(
        *("sweep", "--map", drive / "map.yaml", "--log", later, "--truth", drive / "truth.csv"),
        *("--vary", "recovery=none", "--seeds", 1, "--jobs", 1, "--out", tmp_path / "out"),
    )
    (row,) = rows_of(tmp_path / "out")
    assert float(row["lost"]) == 0.0


def test_a_config_says_which_part_of_the_log_but_not_where_the_robot_starts(
    mcloc: Mcloc, files: list[object], tmp_path: Path
) -> None:
    config = tmp_path / "config.yaml"
    config.write_text("initial: [1.0, 2.0, 3.0]\nstart: 5.0\nend: 20.0\nseed: 77\nthreads: 2\n")
    done = mcloc(
        *("sweep", *files, "--config", config, "--vary", "recovery=none", "--seeds", 1),
        *("--jobs", 1, "--out", tmp_path / "out"),
    )
    assert done.code == 0
    (row,) = rows_of(tmp_path / "out")
    assert (row["seed"], float(row["lost"])) == ("0", 0.0)


def test_a_search_is_judged_up_to_the_first_kidnapping(
    mcloc: Mcloc, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path
) -> None:
    """Found at once, then carried off, and never found again without random particles."""
    folder = tmp_path_factory.mktemp("kidnapped")
    mcloc(
        *("simulate", "--length", 40, "--kidnap-at", 50, "--seed", 2, "--format", "carmen"),
        *("--out", folder),
    )
    files = ["--map", folder / "map.yaml", "--log", folder / "log.gz"]
    mcloc(
        *("sweep", *files, "--truth", folder / "truth.csv", "--vary", "recovery=none"),
        *("--set", "size.minimum=50000", "--starts", 1, "--seeds", 1, "--jobs", 1),
        *("--out", tmp_path),
    )
    (row,) = rows_of(tmp_path)
    assert row["converged"] == "True"
    assert json.loads(row["recoveries"])[0][1] is None
    assert float(row["lost"]) > 0.2


def test_a_truth_of_another_log_is_told(mcloc: Mcloc, drive: Path, tmp_path: Path) -> None:
    other = tmp_path / "truth.csv"
    other.write_text("t,x,y,theta\n90000.0,1,1,0\n90001.0,2,1,0\n")
    done = mcloc(
        *("sweep", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--truth", other),
        *("--vary", "recovery=none", "--out", tmp_path / "out"),
    )
    assert done.code == 2
    assert done.stderr.startswith("error: the truth says nothing of the log: its stamps are 90000")


def test_a_sweep_is_gone_on_with_with_more_values_but_not_with_other_settings(
    mcloc: Mcloc, files: list[object], tmp_path: Path
) -> None:
    sweep = ("sweep", *files, "--seeds", 1, "--jobs", 1, "--out", tmp_path)
    assert mcloc(*sweep, "--vary", "sensor.sigma_hit=0.1").code == 0
    more = mcloc(*sweep, "--vary", "sensor.sigma_hit=0.1,0.2", "--resume")
    assert more.code == 0
    assert len(rows_of(tmp_path)) == 2
    other = mcloc(
        *sweep, "--vary", "sensor.sigma_hit=0.1", "--resume", "--set", "motion.alpha1=0.3"
    )
    assert other.code == 2
    assert "was begun with other settings: " in other.stderr
