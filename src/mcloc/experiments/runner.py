"""A study from its first run to its results: what is in the journal already is not made again."""

import platform
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from mcloc import __version__
from mcloc.errors import ConfigError
from mcloc.experiments.engine import performed
from mcloc.experiments.journal import Journal, key
from mcloc.experiments.results import write_results, write_table
from mcloc.experiments.study import Study
from mcloc.experiments.table import Row, Setting, Table


@dataclass(frozen=True)
class Plan:
    """What of a study is to be run. seeds: 0 … seeds − 1 in each setting. missing: {why: how many
    settings are left out for it}.
    """

    study: Study
    settings: tuple[Setting, ...]
    seeds: int
    missing: dict[str, int]

    @classmethod
    def of(cls, study: Study, seeds: int | None = None) -> "Plan":
        """All that can be run here. Raises ConfigError where nothing can."""
        if seeds is not None and seeds < 1:
            raise ConfigError(f"--runs: at least one run for each setting, got {seeds}")
        settings, missing = [], dict[str, int]()
        for setting in study.settings():
            why = study.missing(setting)
            if why is None:
                settings.append(setting)
            else:
                missing[why] = missing.get(why, 0) + 1
        if not settings:
            raise ConfigError(
                f"{study.number}: nothing of it can be run here: {'; '.join(missing)}"
            )
        return cls(study, tuple(settings), seeds or study.seeds, missing)

    def tasks(self) -> list[tuple[Setting, int]]:
        """Seed by seed, so that what is left of an interrupted study is still a comparison."""
        return [(setting, seed) for seed in range(self.seeds) for setting in self.settings]

    def sorted(self, rows: Iterator[Row]) -> Table:
        """Those that belong to the plan, in its order."""
        order = {key(setting, seed): n for n, (setting, seed) in enumerate(self._by_setting())}
        chosen = [row for row in rows if key(row.setting, row.seed) in order]
        return Table(sorted(chosen, key=lambda row: order[key(row.setting, row.seed)]))

    def _by_setting(self) -> Iterator[tuple[Setting, int]]:
        return ((setting, seed) for setting in self.settings for seed in range(self.seeds))


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
    header = {"study": study.number, "mcloc": __version__, "fingerprint": study.fingerprint}
    with Journal(folder, header, resume) as journal:
        todo = [task for task in plan.tasks() if key(*task) not in journal.rows]
        for _ in range(len(plan.tasks()) - len(todo)):
            done(None)
        try:
            with closing(performed(study.run, todo, jobs=jobs, cluster=cluster)) as rows:
                for row in rows:
                    journal.add(row)
                    done(row)
        finally:
            table = plan.sorted(iter(journal.rows.values()))
            write_table(table, folder)
    write_results(study, plan.seeds, plan.missing, table, folder, _made_by())
    return table


def _made_by() -> str:
    """What a result may depend on, besides the seed."""
    import numpy as np

    return f"mcloc {__version__}, Python {platform.python_version()}, NumPy {np.__version__}"
