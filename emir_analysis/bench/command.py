"""`emir bench WHAT`: its parts one after the other, as lines and, if wanted, as JSON."""

import argparse
from collections.abc import Callable, Iterator
from importlib.util import find_spec

from emir_analysis.bench.timing import Figure, text, write_json
from emir_analysis.errors import InputError
from emir_analysis.outputs import check_outputs

Part = Callable[[float], Iterator[tuple[str, list[Figure]]]]


def plant(seconds: float) -> Iterator[tuple[str, list[Figure]]]:
    """Yield titles and figures of the machine's models."""
    from emir_analysis.bench.joint import joint_figures  # noqa: PLC0415 (compiles)

    yield from joint_figures(seconds)
    if find_spec("pinocchio") is None:
        why = "needs Pinocchio: pip install 'emir_ros[robot]'"
        yield "Robot, 96 freedoms", [Figure("robot", None, "s/s", note=why)]
        return
    from emir_analysis.bench.robot import robot_figures  # noqa: PLC0415 (as above)

    yield from robot_figures(seconds)


def control(seconds: float) -> Iterator[tuple[str, list[Figure]]]:
    """Yield titles and figures of the controllers."""
    from emir_analysis.bench.control import control_figures  # noqa: PLC0415 (as above)

    yield from control_figures(seconds)


PARTS: dict[str, Part] = {"plant": plant, "control": control}


def command(options: argparse.Namespace, show: Callable[[str], None]) -> None:
    """Measure what the options say, a part shown as soon as it is there."""
    if not options.seconds > 0.0:
        raise InputError(f"--seconds {options.seconds:g}: has to be positive")
    check_outputs([options.json], None, [])
    found = {}
    for title, figures in PARTS[options.what](options.seconds):
        show(text(title, figures))
        found[title] = figures
    if options.json:
        write_json(found, options.json)
