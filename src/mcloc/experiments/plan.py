"""What of a study is to be run here, and in which order."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from mcloc.errors import ConfigError
from mcloc.experiments.journal import key
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

    def sorted(self, rows: Iterable[Row]) -> Table:
        """Those that belong to the plan, in its order."""
        order = {key(setting, seed): n for n, (setting, seed) in enumerate(self._by_setting())}
        chosen = [row for row in rows if key(row.setting, row.seed) in order]
        return Table(sorted(chosen, key=lambda row: order[key(row.setting, row.seed)]))

    def _by_setting(self) -> Iterator[tuple[Setting, int]]:
        return ((setting, seed) for setting in self.settings for seed in range(self.seeds))
