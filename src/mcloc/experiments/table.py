"""What a study found: a row for each setting and seed."""

import csv
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Value = str | int | float | bool
Setting = Mapping[str, Value]
Record = Mapping[str, Any]

TOLD = ("seed", "error", "took_s")  # columns of every table


@dataclass(frozen=True)
class Row:
    """One run. setting: {factor: value}. record: what it measured, as JSON knows it; None where it
    raised `error`. took: seconds of computing.
    """

    setting: Setting
    seed: int
    record: Record | None
    error: str | None = None
    took: float = 0.0


class Table:
    """Rows in the order of settings, then of seeds."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self.rows = tuple(rows)

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def failed(self) -> tuple[Row, ...]:
        """Those that raised."""
        return tuple(row for row in self.rows if row.record is None)

    def where(self, **setting: Value) -> "Table":
        """The rows with these values of factors."""
        return Table(
            [
                row
                for row in self.rows
                if all(row.setting.get(name) == value for name, value in setting.items())
            ]
        )

    def values(self, factor: str) -> list[Value]:
        """The values of a factor that occur, in the order of the rows."""
        return list(
            dict.fromkeys(row.setting[factor] for row in self.rows if factor in row.setting)
        )

    def column(self, metric: str) -> NDArray[np.float64]:
        """(N,): a metric of the rows that did not raise, NaN where it is None."""
        found = [row.record[metric] for row in self.rows if row.record is not None]
        return np.array([np.nan if value is None else value for value in found], dtype=np.float64)

    def records(self) -> list[Record]:
        """Those of the rows that did not raise."""
        return [row.record for row in self.rows if row.record is not None]

    def paired(
        self, metric: str, a: Setting, b: Setting
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A metric in two settings, seed by seed; a seed of which either raised is left out of
        both.
        """
        one, other = (
            {row.seed: row.record[metric] for row in self.where(**s).rows if row.record is not None}
            for s in (a, b)
        )
        seeds = [seed for seed in one if seed in other]
        return np.array([one[s] for s in seeds]), np.array([other[s] for s in seeds])

    def columns(self) -> list[str]:
        """The names of factors, of metrics, and of what is told of every run."""
        factors = dict.fromkeys(name for row in self.rows for name in row.setting)
        metrics = dict.fromkeys(name for record in self.records() for name in record)
        return ["seed", *factors, *metrics, "error", "took_s"]

    def lines(self) -> Iterator[list[Any]]:
        """Each row's cells, as `columns` has them; None for what is not known. Lists are JSON."""
        names = self.columns()
        for row in self.rows:
            cells = {
                "seed": row.seed,
                **row.setting,
                **(row.record or {}),
                "error": row.error,
                "took_s": round(row.took, 3),
            }
            yield [_cell(cells.get(name)) for name in names]

    def to_csv(self) -> str:
        """As CSV; what is not known is empty."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns())
        writer.writerows(self.lines())
        return text.getvalue()


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | dict) else value
