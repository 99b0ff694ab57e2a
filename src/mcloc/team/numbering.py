"""Which numbers of a numbered stream of messages have come: once, twice, or never."""

REMEMBERED = 1024  # behind the highest


class Numbering:
    """Numbers 0, 1, … in any order, some of them twice, some never; a bounded memory of them.

    Counting begins with the first one that comes: what was sent before is not missed. came: how
    many came for the first time. highest: of them, −1 before the first.
    """

    def __init__(self) -> None:
        self.came = 0
        self.highest = self._first = -1
        self._recent: set[int] = set()

    def fault(self, number: int) -> str:
        """Why a number is not news, or nothing: then it is noted."""
        if number in self._recent:
            return "duplicate"
        if number <= self.highest - REMEMBERED:
            return "older than can be told from a duplicate"
        self._first = number if self.came == 0 else min(number, self._first)
        self.came += 1
        self._recent.add(number)
        if number > self.highest:
            self.highest = number
            if len(self._recent) > 2 * REMEMBERED:
                self._recent = {n for n in self._recent if n > number - REMEMBERED}
        return ""

    @property
    def missing(self) -> int:
        """How many have not come, of those between the first and the highest that came."""
        return 0 if self.came == 0 else self.highest + 1 - self._first - self.came
