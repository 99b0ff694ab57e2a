"""What a person sees on stderr while a run goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mcloc.kernels.compiling import announced

if TYPE_CHECKING:
    from mcloc.localizer import Estimate


@contextmanager
def shown() -> Iterator[Callable[["Estimate"], None]]:
    """A function to call with each estimate. On a terminal it keeps a line up to date."""
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, soft_wrap=True)
    columns = (
        SpinnerColumn(),
        TextColumn("{task.completed:.0f} scans"),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[spread]}"),
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
        task = progress.add_task("", total=None, rate="", spread="")

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
