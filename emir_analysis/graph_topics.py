"""Which topic of a recording is which of the graph's, in whatever namespace the graph ran."""

from dataclasses import dataclass
from pathlib import Path

from emir_analysis import bags
from emir_analysis.errors import InputError, listed
from emir_msgs_py.topics import OFFERED_COMMANDS, Topic

OFFERED = tuple(f"/{topic.name}" for topic in OFFERED_COMMANDS.values())


@dataclass(frozen=True)
class GraphTopics:
    """The topics in a recording. names: with their namespaces."""

    bag: Path
    names: frozenset[str]

    def full_name(self, topic: Topic | str) -> str | None:
        """Return the recorded name of a topic of the table's, or of a relative name.

        Raises InputError where several graphs were recorded together: which is meant nobody knows.
        """
        relative = topic if isinstance(topic, str) else topic.name
        found = sorted(name for name in self.names if name.endswith(f"/{relative}"))
        found = [name for name in found if not self._is_offer(name, relative)]
        if len(found) > 1:
            told = f"{relative} of more than one machine: {', '.join(found)}"
            raise InputError(f"{self.bag}: {told}; record the topics of one alone")
        return found[0] if found else None

    def _is_offer(self, name: str, relative: str) -> bool:
        """Tell whether a name is a controller's offer beside the chosen command: no namespace."""
        chosen = {name.removesuffix(offer) for offer in OFFERED if name.endswith(offer)}
        return any(f"{start}/{relative}" in self.names - {name} for start in chosen)

    def needed(self, topic: Topic) -> str:
        """Return the recorded name of a topic. Raises InputError, too, where it is not there."""
        name = self.full_name(topic)
        if name is None:
            raise InputError(f"{self.bag}: no topic {topic.name}; there are {listed(self.names)}")
        return name


def graph_topics(bag: Path) -> GraphTopics:
    """Return the topics in a recording. Raises InputError as `bags.read`."""
    return GraphTopics(bag, frozenset(bags.recorded_topics(bag)))
