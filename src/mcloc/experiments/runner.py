"""A study from its first run to its results: what is in the journal already is not made again."""

import platform
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from mcloc import __version__
from mcloc.experiments.engine import performed, sources
from mcloc.experiments.journal import Journal
from mcloc.experiments.plan import Plan
from mcloc.experiments.results import write_results, write_table
from mcloc.experiments.table import Row, Table


def opened(plan: Plan, folder: Path, resume: bool) -> Journal:
    """The journal of a plan in a folder that exists. Raises StateError for one that cannot be gone
    on with.
    """
    study = plan.study
    inputs = [[str(path), path.stat().st_size, path.stat().st_mtime_ns] for path in study.inputs()]
    header = {
        "study": study.number,
        "mcloc": f"{__version__} ({sources()[:12]})",
        "base": study.base,
        "inputs": inputs,
    }
    return Journal(folder, header, resume)


def conduct(
    plan: Plan,
    folder: Path,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    resume: bool = False,
    done: Callable[[Row | None], None] = lambda row: None,
) -> Table:
    """Make the runs of a plan and write what they show into a folder that exists.

    done: called with each row, and with None for one that the journal had already. However this
    ends, table.csv holds the rows so far. Raises StateError for a journal that cannot be gone on
    with, ConfigError where the folder cannot be written or the cluster cannot be used.
    """
    study = plan.study
    with opened(plan, folder, resume) as journal:
        todo = [task for task in plan.tasks() if not journal.has(*task)]
        for _ in range(len(plan.tasks()) - len(todo)):
            done(None)
        try:
            with closing(performed(study.run, todo, jobs=jobs, cluster=cluster)) as rows:
                for row in rows:
                    journal.add(row)
                    done(row)
        finally:
            table = plan.sorted(journal.rows.values())
            write_table(table, folder)
    write_results(plan, table, folder, _made_by())
    return table


def _made_by() -> str:
    """What a result may depend on, besides the seed."""
    import numpy as np

    return f"mcloc {__version__}, Python {platform.python_version()}, NumPy {np.__version__}"
