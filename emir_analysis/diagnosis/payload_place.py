"""Where on the boom a payload sits: at the TCP, unless the recordings say otherwise.

Looked for where one at the TCP leaves something: whatever else is missing would lead it away.
"""

from emir_analysis.diagnosis.trial import Trial
from emir_analysis.diagnosis.unknowns import in_proportion
from emir_plant.effects.payload import Payload

PLACE = "effects.payload.place"


def with_place(known: Trial) -> Trial | None:
    """Return a trial whose payload's place is fitted, too; None: no payload, or it is already."""
    if "payload" not in known.effects or PLACE in known.unknowns.values(known.x):
        return None
    place = in_proportion("payload", "place", 1.0, known.form[PLACE])
    return known.formed({PLACE: Payload.place}).also(place)
