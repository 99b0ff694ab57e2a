"""What somebody should know while a robot runs with others, since it looks like a mistake."""

from collections.abc import Callable

from mcloc.team.inbox import NAMESAKE
from mcloc.team.post import Post

DIFFERING = {
    "detection": "another detection model: neither of the two uses what the other one tells; give "
    "all robots of a team the same --set detection",
    "map": "another map: what the two tell each other is right only if both are of one frame",
    "landmarks": "other landmarks: what the two tell each other is right only if all are of one "
    "frame",
}
"""What another robot has that is not as this one's."""


def silent(_: str) -> None:
    """Nobody is told."""


class Remarks:
    """Each is said once, by `say`."""

    def __init__(self, post: Post, say: Callable[[str], None]) -> None:
        self._post, self._say = post, say
        self._said: set[str] = set()

    def once(self, remark: str) -> None:
        """Say it, unless it has been said."""
        if remark not in self._said:
            self._said.add(remark)
            self._say(remark)

    def look(self) -> None:
        """Say what has turned up."""
        name, inbox = self._post.name, self._post.inbox
        if inbox.dropped[NAMESAKE]:
            self.once(f"another robot is called {name}, too; give each a name of its own")
        for peer in inbox.peers.values():
            for what in inbox.differing(peer):
                self.once(f"robot {peer.name} has {DIFFERING[what]}")
