"""Many runs at once: by joblib in processes of this machine, or by Dask on a cluster of them."""

import json
import logging
import os
import time
import traceback
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import closing, contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import mcloc
from mcloc import __version__
from mcloc.errors import ConfigError
from mcloc.experiments.table import Record, Row, Setting
from mcloc.kernels.jit import set_threads

Run = Callable[[Setting, int], Record]
Task = tuple[Setting, int]
CONNECT_WITHIN = 10.0  # s


def performed(
    run: Run, tasks: Sequence[Task], *, jobs: int = 1, cluster: str | None = None
) -> Generator[Row]:
    """A row for each (setting, seed), as they are finished; no order is promised.

    run: a function that another process can import, with arguments that can be sent. jobs:
    processes here, −1 for one a core. cluster: address of a Dask scheduler, whose workers are used
    instead; what one of them had to do when it died is done by another. Close the generator to stop
    early. Raises ConfigError where the cluster cannot be used, or is lost.
    """
    rows = _here(run, tasks, jobs) if cluster is None else _on_cluster(run, tasks, cluster)
    with closing(rows):
        yield from rows


def _here(run: Run, tasks: Sequence[Task], jobs: int) -> Generator[Row]:
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    parallel = Parallel(n_jobs=jobs, batch_size=1, return_as="generator_unordered")
    with (
        warnings.catch_warnings(),
        closing(parallel(delayed(_in_folder)(os.getcwd(), run, *task) for task in tasks)) as rows,
    ):
        warnings.filterwarnings("ignore", module="joblib")  # that closing it early stops the rest
        try:
            yield from rows
        except TerminatedWorkerError as cause:
            raise ConfigError(
                "a process was killed, perhaps for lack of memory; --resume goes on, and fewer "
                "--jobs need less"
            ) from cause


def _in_folder(folder: str, run: Run, setting: Setting, seed: int) -> Row:
    """joblib keeps its processes for the next study, which may be asked for in another folder."""
    os.chdir(folder)
    return attempt(run, setting, seed)


def _on_cluster(run: Run, tasks: Sequence[Task], cluster: str) -> Generator[Row]:
    """By Dask's own futures: joblib's backend waits for ever for a run that kills its workers."""
    with _client(cluster) as client:
        from distributed import as_completed

        finished: Any = as_completed
        task_of = {client.submit(attempt, run, *task, pure=False): task for task in tasks}
        try:
            for future in finished(list(task_of), loop=client.loop):
                try:
                    yield future.result()
                except CancelledError as cause:
                    raise ConfigError(
                        f"--cluster {cluster}: the scheduler was lost; start it again and go on "
                        "with --resume"
                    ) from cause
                except Exception as cause:  # it killed one worker after the other
                    yield Row(*task_of[future], None, _told(cause))
        finally:
            client.cancel(list(task_of))


def attempt(run: Run, setting: Setting, seed: int) -> Row:
    """A run as a row, also where it raises. It has one thread, for there are many runs."""
    set_threads(1)
    began = time.perf_counter()
    record: Record | None
    try:
        record, error = _checked(run(setting, seed), setting), None
    except Exception as cause:
        record, error = None, _told(cause)
    return Row(setting, seed, record, error, time.perf_counter() - began)


def _checked(record: Record, setting: Setting) -> Record:
    """A record that a journal and a table can keep."""
    json.dumps(record, allow_nan=False)
    if both := set(record) & set(setting):
        raise ValueError(f"{', '.join(both)} is a factor and a metric")
    return record


def _told(cause: Exception) -> str:
    """An error on one line: what it is, and where it was raised."""
    last = traceback.extract_tb(cause.__traceback__)[-1]
    where = f"{last.filename.rpartition('/')[2]}:{last.lineno}"
    return " ".join(f"{type(cause).__name__}: {cause} ({where})".split())


@contextmanager
def _client(cluster: str) -> Iterator[Any]:
    """A connection to a cluster that can be used."""
    try:
        from distributed import Client
    except ImportError as cause:
        raise ConfigError(
            "--cluster needs Dask distributed: python -m pip install 'mcloc[cluster]'"
        ) from cause
    # What goes wrong is raised here; Dask would print tracebacks of it besides.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    connect: Any = Client
    try:
        client = connect(cluster, timeout=CONNECT_WITHIN, set_as_default=False)
    except (OSError, ValueError, TypeError) as cause:
        raise ConfigError(
            f"--cluster {cluster}: no scheduler answers there ({cause}); `dask scheduler` starts "
            "one and prints its address, such as tcp://127.0.0.1:8786"
        ) from cause
    with client:
        _check_workers(client, cluster)
        yield client


def _check_workers(client: Any, cluster: str) -> None:
    """Raises ConfigError where there are no workers, or they have another mcloc."""
    if not client.ncores():
        raise ConfigError(f"--cluster {cluster}: has no workers; `dask worker {cluster}` adds one")
    try:
        found = client.run(sources)
    except ModuleNotFoundError as cause:
        raise ConfigError(f"--cluster {cluster}: a worker lacks mcloc; install it there") from cause
    for worker, theirs in found.items():
        if theirs != sources():
            raise ConfigError(
                f"--cluster {cluster}: worker {worker} has another mcloc than this one, "
                f"{__version__}; install the same everywhere"
            )


@cache
def sources() -> str:
    """Tells one mcloc from another that calls itself the same."""
    package = Path(mcloc.__file__).parent
    told = sha256()
    for path in sorted(package.rglob("*.py")):
        told.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return told.hexdigest()
