"""What a person sees on stderr while long work goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mcloc.kernels.compiling import announced

if TYPE_CHECKING:
    from mcloc.localizer import Estimate


@contextmanager
def shown() -> Iterator[Callable[["Estimate"], None]]:
    """A function to call with each estimate of a run."""
    with _line("scans", "rate", "spread") as (progress, task):

        def show(estimate: "Estimate") -> None:
            speed = progress.tasks[task].speed
            covariance = estimate.covariance
            spread = (covariance[0, 0] + covariance[1, 1]) ** 0.5
            progress.update(
                task,
                advance=1,
                rate="" if speed is None else f"{speed:.0f} scans/s",
                spread=f"± {spread:.2f} m, {len(estimate.hypotheses)} hypotheses",
            )

        yield show


@contextmanager
def counted(what: str) -> Iterator[Callable[[], None]]:
    """A function to call for each thing that is done."""
    with _line(what) as (progress, task):
        yield lambda: progress.advance(task)


@contextmanager
def _line(what: str, *fields: str) -> Iterator[tuple[Any, Any]]:
    """A progress and its task; on a terminal it keeps a line with a count and the fields up to
    date. Kernels that have to be compiled are announced.
    """
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, soft_wrap=True)
    columns = (
        SpinnerColumn(),
        TextColumn(f"{{task.completed:.0f}} {what}"),
        *(TextColumn(f"{{task.fields[{field}]}}") for field in fields),
        TimeElapsedColumn(),
    )

    def compiling() -> None:
        console.print("first run: compiling the kernels, once; some ten seconds ...")

    with (
        announced(compiling),
        Progress(
            *columns, console=console, transient=True, disable=not console.is_terminal
        ) as progress,
    ):
        empty: dict[str, Any] = dict.fromkeys(fields, "")
        yield progress, progress.add_task("", total=None, **empty)
