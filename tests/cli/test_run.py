"""`mcloc run`: what it writes, that it repeats, and what it says when something is wrong."""

import csv
import gzip
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from mcloc.io.tum import read_trajectory

COLUMNS = (
    "t,x,y,theta,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,n_particles,ess,n_hypotheses,share,"
    "likelihood_fast,likelihood_slow,explained_beams"
)
FILES = {
    "trajectory.tum",
    "estimates.csv",
    "timing.csv",
    "summary.json",
    "config.yaml",
    "run.png",
}
SUMMARY = {
    *("version", "map", "log", "seed", "filter", "sensor", "motion", "scans", "updates"),
    *("duration_s", "distance_m", "realtime_factor", "update_ms", "particles", "ignored"),
    *("final", "withheld", "accuracy"),
}
ACCURACY = {
    *("position_median_m", "position_rmse_m", "position_p95_m", "position_max_m"),
    *("heading_median_deg", "lost_fraction", "converged", "time_to_converge_s"),
    *("distance_to_converge_m", "time_to_find_s", "distance_to_find_m", "localized_fraction"),
    *("nees_median", "recoveries"),
}

Mcloc = Callable[..., Any]


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as stream:
        return list(csv.DictReader(stream))


def summary_of(folder: Path) -> dict[str, Any]:
    def no_constant(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    text = (folder / "summary.json").read_text()
    loaded: dict[str, Any] = json.loads(text, parse_constant=no_constant)
    return loaded


def test_writes_exactly_its_files(tracked: Path) -> None:
    assert {path.name for path in tracked.iterdir()} == FILES
    with Image.open(tracked / "run.png") as picture:
        picture.load()
        assert picture.width > 1000
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 20


def test_estimates_have_a_row_for_each_scan(tracked: Path, drive: Path) -> None:
    assert (tracked / "estimates.csv").read_text().splitlines()[0] == COLUMNS
    estimates = rows(tracked / "estimates.csv")
    truth = read_trajectory(drive / "truth.csv")
    np.testing.assert_allclose([float(row["t"]) for row in estimates], truth.t, atol=1e-6)
    for row in estimates:
        assert 0.0 < float(row["share"]) <= 1.0
        assert 1.0 <= float(row["ess"]) <= float(row["n_particles"])
        assert int(row["n_hypotheses"]) >= 1
        assert 0.0 <= float(row["explained_beams"]) <= 1.0
        assert float(row["cov_xx"]) > 0.0


def test_trajectory_is_that_of_the_estimates(tracked: Path) -> None:
    tum = read_trajectory(tracked / "trajectory.tum")
    table = read_trajectory(tracked / "estimates.csv")
    np.testing.assert_allclose(tum.t, table.t)
    np.testing.assert_allclose(tum.poses, table.poses, atol=2e-6)


def test_timing_has_a_row_for_each_update(tracked: Path) -> None:
    timing = rows(tracked / "timing.csv")
    summary = summary_of(tracked)
    assert list(timing[0]) == ["t", "update_ms"]
    assert len(timing) == summary["updates"] < summary["scans"]
    times = [float(row["update_ms"]) for row in timing]
    assert summary["update_ms"]["median"] == pytest.approx(np.median(times), abs=1e-3)
    assert summary["update_ms"]["max"] == pytest.approx(max(times), abs=1e-3)


def test_summary_agrees_with_the_tables(tracked: Path, drive: Path) -> None:
    summary, estimates = summary_of(tracked), rows(tracked / "estimates.csv")
    truth = read_trajectory(drive / "truth.csv")
    driven = float(np.linalg.norm(np.diff(truth.poses[:, :2], axis=0), axis=1).sum())
    assert set(summary) == SUMMARY
    assert (summary["seed"], summary["filter"], summary["motion"]) == (7, "mixture", "odometry")
    assert summary["sensor"] == "likelihood-field"
    assert summary["scans"] == len(estimates)
    assert summary["duration_s"] == pytest.approx(truth.t[-1] - truth.t[0])
    assert summary["distance_m"] == pytest.approx(driven, rel=0.1)
    assert summary["realtime_factor"] > 0.0
    assert summary["particles"]["max"] == max(int(row["n_particles"]) for row in estimates)
    assert (summary["ignored"], summary["withheld"]) == ({}, 0.0)
    for axis in ("x", "y", "theta"):
        assert summary["final"][axis] == pytest.approx(float(estimates[-1][axis]), abs=1e-6)
        assert summary["final"]["hypotheses"][0][axis] == summary["final"][axis]
    assert len(summary["final"]["hypotheses"]) == int(estimates[-1]["n_hypotheses"])


def test_accuracy_is_that_of_the_estimates(tracked: Path, drive: Path, mcloc: Mcloc) -> None:
    accuracy = summary_of(tracked)["accuracy"]
    assert set(accuracy) == ACCURACY
    assert accuracy["converged"] is True
    assert accuracy["position_median_m"] < 0.15
    assert accuracy["recoveries"] == []
    done = mcloc("eval", tracked, drive / "truth.csv", "--log", drive / "log.gz", "--json")
    again = json.loads(done.stdout)
    assert again["position_median_m"] == pytest.approx(accuracy["position_median_m"], abs=2e-6)
    assert again["lost_fraction"] == accuracy["lost_fraction"]


def test_config_is_complete(tracked: Path) -> None:
    config = yaml.safe_load((tracked / "config.yaml").read_text())
    assert config["seed"] == 7
    assert config["size"] == "kld"
    assert set(config["settings"]) == {
        *("filter", "motion", "sensor", "environment"),
        *("size", "recovery", "sampler", "sightings", "ranging", "camera", "update"),
    }
    assert "sigma_hit" in config["settings"]["sensor"]
    assert "distance" in config["settings"]["update"]


def test_its_config_repeats_a_run(tracked: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc("run", "--config", tracked / "config.yaml", "--out", tmp_path)
    assert done.code == 0, done.stderr
    for name in ("estimates.csv", "trajectory.tum", "config.yaml", "run.png"):
        assert (tmp_path / name).read_bytes() == (tracked / name).read_bytes(), name


def test_options_override_the_config(tracked: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc(
        *("run", "--config", tracked / "config.yaml", "--out", tmp_path, "--size", "fixed"),
        *("--particles", 321, "--set", "sensor.sigma_hit=0.25", "--no-plot", "--end", 5),
    )
    assert done.code == 0, done.stderr
    config = yaml.safe_load((tmp_path / "config.yaml").read_text())
    assert config["settings"]["size"] == {"particles": 321}
    assert config["settings"]["sensor"]["sigma_hit"] == 0.25
    assert config["seed"] == 7
    assert {row["n_particles"] for row in rows(tmp_path / "estimates.csv")} == {"321"}
    assert not (tmp_path / "run.png").exists()


def test_threads_do_not_change_a_byte(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    from mcloc.kernels.jit import SERIAL_BELOW

    particles = 20_000
    assert 40 * particles > SERIAL_BELOW  # else neither run would use its threads
    for threads in (1, 2):
        done = mcloc(
            *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--seed", 3),
            *("--size", "fixed", "--particles", particles, "--threads", threads, "--end", 4),
            *("--no-plot", "--out", tmp_path / f"{threads}"),
        )
        assert done.code == 0, done.stderr
    one, two = ((tmp_path / t / "estimates.csv").read_bytes() for t in "12")
    assert one == two


def test_scans_that_a_slow_computer_loses_are_told(
    tracked: Path, mcloc: Mcloc, tmp_path: Path
) -> None:
    slow, again = tmp_path / "slow", tmp_path / "again"
    done = mcloc(
        *("run", "--config", tracked / "config.yaml", "--out", slow, "--no-plot"),
        *("--pace", "modelled", "--set", "pace.particle_beam=2e-5"),
    )
    assert done.code == 0, done.stderr
    summary, lost = summary_of(slow), "scan while the filter was busy"
    assert summary["ignored"][lost] > 5
    assert f"ignored    {summary['ignored'][lost]} × {lost}" in done.stdout
    assert summary["scans"] == summary_of(tracked)["scans"]
    assert summary["updates"] < summary_of(tracked)["updates"]
    config = yaml.safe_load((slow / "config.yaml").read_text())
    assert config["pace"] == "modelled"
    assert config["settings"]["pace"] == {"particle_beam": 2e-5}
    mcloc(*("run", "--config", slow / "config.yaml", "--out", again, "--no-plot", "--threads", 1))
    assert (again / "estimates.csv").read_bytes() == (slow / "estimates.csv").read_bytes()
    assert summary_of(again)["ignored"] == summary["ignored"]


def test_seeds_differ(tracked: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    mcloc(
        *("run", "--config", tracked / "config.yaml", "--seed", 8, "--no-plot", "--out", tmp_path)
    )
    assert (tmp_path / "estimates.csv").read_bytes() != (tracked / "estimates.csv").read_bytes()


def test_a_seed_is_chosen_and_recorded(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    seeds = set()
    for _ in range(2):
        mcloc(
            *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--end", 1),
            *("--no-plot", "--out", tmp_path),
        )
        seeds.add(yaml.safe_load((tmp_path / "config.yaml").read_text())["seed"])
    assert len(seeds) == 2


def test_start_and_end_are_stamps(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--out", tmp_path),
        *("--start", 2.0, "--end", 6.0, "--no-plot"),
    )
    assert done.code == 0, done.stderr
    stamps = read_trajectory(tmp_path / "estimates.csv").t
    truth = read_trajectory(drive / "truth.csv").t
    np.testing.assert_allclose(stamps, truth[(truth >= 2.0) & (truth <= 6.0)], atol=1e-6)


def test_json_is_the_summary_alone(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--out", tmp_path),
        *("--end", 2, "--no-plot", "--json"),
    )
    assert done.stdout == (tmp_path / "summary.json").read_text()
    assert json.loads(done.stdout)["accuracy"] is None


def test_as_a_program(drive: Path, start: str, tmp_path: Path) -> None:
    program = "import sys; from mcloc.cli.main import main; sys.argv[0] = 'mcloc'; main()"
    arguments = [
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--initial", start),
        *("--end", "2", "--out", tmp_path / "out"),
    ]
    command = [sys.executable, "-c", program, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert str(tmp_path / "out" / "run.png") in done.stdout
    assert (tmp_path / "out" / "run.png").is_file()


def test_a_cut_log_leaves_the_results_so_far(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    whole = (drive / "log.gz").read_bytes()
    cut = tmp_path / "cut.log.gz"
    cut.write_bytes(whole[: len(whole) // 2])
    out = tmp_path / "out"
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", cut, "--seed", 1, "--out", out),
        *("--truth", drive / "truth.csv"),
    )
    assert done.code == 2
    assert "error: " in done.stderr
    assert str(cut) in done.stderr
    assert "Traceback" not in done.stderr
    assert {path.name for path in out.iterdir()} == FILES
    assert 10 < summary_of(out)["scans"] < len(read_trajectory(drive / "truth.csv"))


def test_an_interrupted_run_leaves_the_results_so_far(
    drive: Path, mcloc: Mcloc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mcloc.localizer import Localizer

    process, calls = Localizer.process, []

    def interrupted(self: Localizer, event: Any) -> Any:
        calls.append(event)
        if len(calls) == 60:
            raise KeyboardInterrupt
        return process(self, event)

    monkeypatch.setattr(Localizer, "process", interrupted)
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--out", tmp_path),
    )
    assert done.code == 130
    assert "interrupted" in done.stderr
    assert {path.name for path in tmp_path.iterdir()} == FILES
    assert summary_of(tmp_path)["scans"] == len(rows(tmp_path / "estimates.csv")) > 0


def test_a_foreign_truth_costs_no_results(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    truth = tmp_path / "truth.csv"
    truth.write_text("t,x,y,theta\n90000,1,1,0\n90001,1,1,0\n")
    out = tmp_path / "out"
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--end", 2),
        *("--truth", truth, "--out", out),
    )
    assert done.code == 2
    assert str(truth) in done.stderr
    assert {path.name for path in out.iterdir()} == FILES
    assert summary_of(out)["accuracy"] is None


def test_files_of_an_earlier_run_are_replaced(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    for name in FILES:
        (tmp_path / name).write_text("old")
    (tmp_path / "mine.txt").write_text("kept")
    done = mcloc(
        *("run", "--map", drive / "map.yaml", "--log", drive / "log.gz", "--end", 1),
        *("--out", tmp_path),
    )
    assert done.code == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == FILES | {"mine.txt"}
    assert all((tmp_path / name).read_bytes() != b"old" for name in FILES)


def test_gzip_does_not_matter(drive: Path, mcloc: Mcloc, tmp_path: Path) -> None:
    plain = tmp_path / "plain.log"
    plain.write_bytes(gzip.decompress((drive / "log.gz").read_bytes()))
    for log, out in ((plain, "a"), (drive / "log.gz", "b")):
        mcloc(
            *("run", "--map", drive / "map.yaml", "--log", log, "--seed", 1, "--end", 2),
            *("--no-plot", "--out", tmp_path / out),
        )
    a, b = ((tmp_path / name / "estimates.csv").read_bytes() for name in "ab")
    assert a == b
