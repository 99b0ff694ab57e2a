"""What a person sees on stderr while long work goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from mcloc.kernels.compiling import announced

if TYPE_CHECKING:
    from mcloc.localizer import Estimate

RECENT = 600.0  # s of which the speed is that of now, where a thing may take minutes


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
def counted(what: str, total: int | None = None) -> Iterator[Callable[..., None]]:
    """A function to call for each thing that is done: advance(). Of how many, where that is known,
    tells what time is left; advance(before=True) is for what had been done before, in no time.
    """
    with _line(what, total=total) as (progress, task):

        def advance(*, before: bool = False) -> None:
            if before:
                progress.reset(task, completed=progress.tasks[task].completed + 1)
            else:
                progress.advance(task)

        yield advance


@contextmanager
def _line(what: str, *fields: str, total: int | None = None) -> Iterator[tuple[Any, Any]]:
    """A progress and its task; on a terminal it keeps a line with a count and the fields up to
    date. Kernels that have to be compiled are announced.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        SpinnerColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True, soft_wrap=True)
    count = "{task.completed:.0f}" if total is None else "{task.completed:.0f} of {task.total:.0f}"
    columns: list[ProgressColumn] = [
        SpinnerColumn(),
        TextColumn(f"{count} {what}"),
        *(TextColumn(f"{{task.fields[{field}]}}") for field in fields),
        TimeElapsedColumn(),
    ]
    if total is not None:
        columns[1:1] = [BarColumn()]
        columns += [TextColumn("left:"), TimeRemainingColumn(elapsed_when_finished=False)]

    def compiling() -> None:
        console.print("first run: compiling the kernels, once; some ten seconds ...")

    with (
        announced(compiling),
        Progress(
            *columns,
            console=console,
            transient=True,
            disable=not console.is_terminal,
            speed_estimate_period=30.0 if total is None else RECENT,
        ) as progress,
    ):
        empty: dict[str, Any] = dict.fromkeys(fields, "")
        yield progress, progress.add_task("", total=total, **empty)
