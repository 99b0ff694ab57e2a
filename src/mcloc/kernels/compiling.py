"""When kernels are compiled, somebody waits: tell them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core import event


class _Once(event.Listener):
    """Calls `notice` at the first event, before it begins."""

    def __init__(self, notice: Callable[[], None]) -> None:
        self._notice: Callable[[], None] | None = notice

    def on_start(self, event: event.Event) -> None:
        notice, self._notice = self._notice, None
        if notice is not None:
            notice()

    def on_end(self, event: event.Event) -> None:
        pass


@contextmanager
def announced(notice: Callable[[], None]) -> Iterator[None]:
    """Call notice() before the first kernel that is compiled, not merely loaded from its cache."""
    with event.install_listener("numba:compile", _Once(notice)):
        yield
