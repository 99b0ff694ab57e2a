"""minimum ≤ n ≤ maximum, n found while drawing."""

from dataclasses import dataclass

from mcloc.registry import Configurable, param


@dataclass(frozen=True)
class Adaptive(Configurable):
    """The limits of every size that is found while drawing."""

    minimum: int = param(2000, "", "fewest particles", low=1, high=1e7)
    maximum: int = param(200_000, "", "most particles", low=1, high=1e7)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.maximum < self.minimum:
            raise self.wrong(f"maximum = {self.maximum} must be >= minimum = {self.minimum}")

    @property
    def fixed(self) -> int | None:
        return None
