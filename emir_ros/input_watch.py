"""Whether a node's input comes in time and whether its publishers stay."""

from collections import Counter
from collections.abc import Callable


class InputWatch:
    """Counts missed deadlines and lost publishers of one topic, by clock and graph.

    The middleware has events for both, but one of its threads may then hold the reader and wait
    for the event while the node's holds the event and waits for the reader: the node hangs
    (ros2/rmw_fastrtps, pull request 890, which Jazzy is without).
    """

    def __init__(
        self,
        topic: str,
        deadline: float,
        counts: Counter[str],
        seconds: Callable[[], float],
        publishers: Callable[[], int],
    ) -> None:
        """Watch a topic; deadline: s between two messages, 0 for none.

        counts: what is added to. seconds: the time, s. publishers: how many there are.
        """
        self._missed, self._lost = f"{topic}: deadline missed", f"{topic}: publisher lost"
        self._deadline, self._counts = deadline, counts
        self._seconds, self._publishers = seconds, publishers
        self._since: float | None = None  # s, the last message or the last deadline missed
        self._there = 0

    def tick(self) -> None:
        """Note that a message has come."""
        if self._deadline:  # asking for the time takes longer than all else
            self._count_missed()
            self._since = self._seconds()

    def look(self) -> None:
        """Count what was missed and who has gone since the last look."""
        self._count_missed()
        there = self._publishers()
        if there < self._there:
            self._counts[self._lost] += self._there - there
        self._there = there

    def _count_missed(self) -> None:
        """Count every deadline that has passed without a message, as DDS does."""
        if self._since is None:
            return
        missed = int((self._seconds() - self._since) / self._deadline)
        if missed > 0:
            self._counts[self._missed] += missed
            self._since += missed * self._deadline
