"""n: what another run noted that it drew, so that a run which followed the clock can be repeated.

A file of sizes is CSV with the header `step,nth,n`: the nth sample set of a step, both from 0, had
n particles.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from mcloc.errors import ConfigError
from mcloc.protocols import Counter
from mcloc.registry import Configurable, param
from mcloc.sample_size.fixed import Until
from mcloc.statespace import StateSpace
from mcloc.textfile import TextFile

HEADER = "step,nth,n"
_ROW = re.compile(r"([0-9]{1,9}),([0-9]{1,9}),([1-9][0-9]{0,7})")


@dataclass(frozen=True)
class Recorded(Configurable):
    """The sizes of another run, from the sizes.csv among its results.

    With the same map, log, seed and parts it repeats that run to the last bit, provided that its
    sizes were found while drawing: a set whose size is known beforehand is resampled otherwise.
    Raises ConfigError for a file that is no such table, and where a set is drawn of which it says
    nothing.
    """

    file: str = param("", "", "sizes.csv of the run to repeat")
    _sizes: Mapping[tuple[int, int], int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.file:
            raise self.wrong("file must name the sizes.csv of the run to repeat")
        object.__setattr__(self, "_sizes", read_sizes(self.file))

    @property
    def fixed(self) -> int | None:
        return None

    def counter(self, space: StateSpace, step: int, nth: int) -> Counter:
        if (step, nth) not in self._sizes:
            raise ConfigError(
                f"{self.file}: holds no size for step {step}, set {nth}; "
                "is it from a run with this map, log, seed and settings?"
            )
        return Until(self._sizes[step, nth])


def sizes_csv(sizes: Iterable[Iterable[float]]) -> str:
    """Rows (step, nth, n) of whole numbers as a file for `read_sizes`."""
    rows = (",".join(str(int(number)) for number in size) for size in sizes)
    return "".join(f"{row}\n" for row in (HEADER, *rows))


def read_sizes(path: str) -> dict[tuple[int, int], int]:
    """{(step, nth): n}. Raises ConfigError, with file and line, for anything but such a table."""
    text = TextFile(path, ConfigError)
    sizes: dict[tuple[int, int], int] = {}
    for number, line in text.lines():
        if number == 1:
            if line.strip() != HEADER:
                raise text.fault(
                    number, f"not the header {HEADER!r}; is it the sizes.csv of a run?"
                )
            continue
        row = _ROW.fullmatch(line.strip())
        if row is None:
            raise text.fault(
                number, f"not {HEADER} as whole numbers, n >= 1: {line.strip()[:80]!r}"
            )
        step, nth, n = map(int, row.groups())
        if (step, nth) in sizes:
            raise text.fault(number, f"a second size for step {step}, set {nth}")
        sizes[step, nth] = n
    if not sizes:
        raise ConfigError(f"{path}: holds no sizes; is it the sizes.csv of a run?")
    return sizes
