"""Which numbers of a numbered stream of messages have come: once, twice, or never."""

REMEMBERED = 1024  # behind the highest


class Numbering:
    """Numbers 0, 1, … in any order, some of them twice, some never; a bounded memory of them.

    Counting begins with the first one that comes: what was sent before is not missed. A number far
    ahead of all is left out until another one beside it comes: a single one that is wrong or forged
    must not make all others old. came: how many came for the first time. highest: of them, −1
    before the first.
    """

    def __init__(self) -> None:
        self.came = 0
        self.highest = self._first = -1
        self._recent: set[int] = set()
        self._leap: int | None = None  # the last one that was far ahead

    def stale(self, number: int) -> str:
        """Why a number cannot be news, or nothing."""
        if number in self._recent:
            return "duplicate"
        if number <= self.highest - REMEMBERED and self.came > 1:
            return "older than can be told from a duplicate"
        return ""

    def fault(self, number: int) -> str:
        """Why a number is not news, or nothing: then it is noted."""
        fault = self.stale(number) or self._leaps(number)
        if fault:
            return fault
        if number <= self.highest - REMEMBERED:  # behind a single one, which was the wrong one
            self.came, self._recent = 0, set()
        if self.came == 0:
            self.highest = self._first = number
        self._first = min(number, self._first)
        self.came += 1
        self._recent.add(number)
        if number > self.highest:
            self.highest = number
            if len(self._recent) > 2 * REMEMBERED:
                self._recent = {n for n in self._recent if n > number - REMEMBERED}
        return ""

    def _leaps(self, number: int) -> str:
        """Why a number far ahead is not believed yet, or nothing."""
        if self.came == 0 or number <= self.highest + REMEMBERED:
            return ""
        leap, self._leap = self._leap, number
        beside = leap is not None and 0 < abs(number - leap) <= REMEMBERED
        return "" if beside else "numbered far ahead of all others"

    @property
    def missing(self) -> int:
        """How many have not come, of those between the first and the highest that came."""
        return 0 if self.came == 0 else self.highest + 1 - self._first - self.came
