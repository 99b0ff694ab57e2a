"""Every run exactly once, and the same bytes, wherever it is made."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mcloc.errors import ConfigError
from mcloc.experiments.engine import attempt, performed
from mcloc.experiments.journal import key
from mcloc.experiments.table import Record, Row, Setting

from .conftest import REAL, REAL_TASKS, toy_run

WAIT = 60.0  # s until scheduler and workers are there


def by_task(rows: Iterator[Row]) -> dict[str, Row]:
    """The rows without the time that they took; each run is made once."""
    found: dict[str, Row] = {}
    for row in rows:
        assert key(row.setting, row.seed) not in found
        found[key(row.setting, row.seed)] = replace(row, took=0.0)
    return found


def broken(setting: Setting, seed: int) -> Record:
    if seed == 1:
        raise ValueError("seed 1\nis bad")
    return {"y": 1.0}


def test_a_run_that_raises_is_a_row_with_its_error_on_one_line() -> None:
    rows = {row.seed: row for row in performed(broken, [({}, 0), ({}, 1)])}
    assert rows[0].record == {"y": 1.0}
    assert rows[0].error is None
    assert rows[1].record is None
    assert rows[1].error is not None
    assert rows[1].error.startswith("ValueError: seed 1 is bad (test_engine.py:")


def test_a_metric_named_as_a_factor_is_an_error() -> None:
    row = attempt(lambda setting, seed: {"x": 1.0}, {"x": 1}, 0)
    assert row.record is None
    assert "x is a factor and a metric" in str(row.error)


def test_interrupting_a_run_is_no_error_of_it() -> None:
    def interrupted(setting: Setting, seed: int) -> Record:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt(interrupted, {}, 0)


def where(setting: Setting, seed: int) -> Record:
    return {"folder": os.getcwd()}


def test_kept_processes_work_in_the_folder_of_today(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        rows = performed(where, [({}, seed) for seed in range(4)], jobs=2)
        found = [row.record["folder"] for row in rows if row.record is not None]
        assert found == 4 * [str(tmp_path / name)]


def test_processes_give_what_one_process_gives() -> None:
    alone = by_task(performed(REAL, REAL_TASKS[:4]))
    assert all(row.error is None for row in alone.values())
    assert by_task(performed(REAL, REAL_TASKS[:4], jobs=2)) == alone


class Cluster:
    """A scheduler and two workers on loopback, processes of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.processes = folder, list[subprocess.Popen[bytes]]()
        self._start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", *self._quiet("s"))
        self.address = str(self._known("s")["address"])
        self.scheduler = self.processes[0]
        self.workers = [
            # Without a nanny, so that what is killed is the worker and nobody starts it again.
            self._start(
                "dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"
            )
            for _ in range(2)
        ]

    def _quiet(self, name: str) -> list[str]:
        return [
            "--no-dashboard",
            "--no-show",
            "--scheduler-file",
            str(self.folder / f"{name}.json"),
        ]

    def _start(self, program: str, *arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.{program}", *arguments]
        with (self.folder / "log").open("ab") as log:
            self.processes.append(
                subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)
            )
        return self.processes[-1]

    def _known(self, name: str) -> dict[str, object]:
        until = time.monotonic() + WAIT
        while time.monotonic() < until:
            try:
                return dict(json.loads((self.folder / f"{name}.json").read_text()))
            except (OSError, ValueError):
                time.sleep(0.05)
        raise TimeoutError((self.folder / "log").read_text())

    def wait_for_workers(self, n: int) -> None:
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(n, timeout=WAIT)

    def close(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    if importlib.util.find_spec("distributed") is None:
        pytest.skip("needs Dask distributed, the extra `cluster`")
    started = Cluster(tmp_path)
    try:
        yield started
    finally:
        started.close()


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_makes_every_run_once_and_the_same(cluster: Cluster) -> None:
    cluster.wait_for_workers(2)
    alone = by_task(performed(REAL, REAL_TASKS))

    def watched() -> Iterator[Row]:
        for done, row in enumerate(performed(REAL, REAL_TASKS, cluster=cluster.address)):
            if done == 1:  # in the middle: there is work left, some of it half done
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
            yield row

    assert by_task(watched()) == alone
    assert cluster.workers[0].poll() is not None


@pytest.mark.slow
def test_a_cluster_that_is_lost_is_an_error_and_no_endless_wait(cluster: Cluster) -> None:
    cluster.wait_for_workers(2)
    rows = performed(REAL, REAL_TASKS * 5, cluster=cluster.address)
    next(rows)
    cluster.scheduler.kill()
    with pytest.raises(ConfigError, match=r"the scheduler was lost; .* --resume"):
        list(rows)


def test_a_cluster_without_workers_is_told(cluster: Cluster) -> None:
    for worker in cluster.workers:
        worker.kill()
        worker.wait()
    time.sleep(0.5)
    with pytest.raises(ConfigError, match="has no workers; `dask worker tcp://127"):
        list(performed(toy_run, [({"x": 1}, 0)], cluster=cluster.address))


def test_an_address_where_nobody_answers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("mcloc.experiments.engine.CONNECT_WITHIN", 0.5)
    with pytest.raises(ConfigError, match=r"--cluster tcp://127\.0\.0\.1:9: no scheduler answers"):
        list(performed(toy_run, [({"x": 1}, 0)], cluster="tcp://127.0.0.1:9"))


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ConfigError, match=r"pip install 'mcloc\[cluster\]'"):
        list(performed(toy_run, [({"x": 1}, 0)], cluster="tcp://127.0.0.1:9"))
