"""`emir urdf`: the robot's description as a file."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from emir_analysis.outputs import check_outputs, write_text
from emir_plant.robot import require_pinocchio
from emir_plant.robot.sheet import robot


def _parser() -> argparse.ArgumentParser:
    about = "The whole robot as URDF: every joint, linkage part and cut. Needs the extra `robot`."
    options = argparse.ArgumentParser(prog="emir urdf", description=about)
    options.add_argument("file", type=Path, metavar="FILE", help="URDF to write")
    options.add_argument("--robot", type=Path, metavar="YAML", help="default: EMIR's robot.yaml")
    options.add_argument(
        "--machine", type=Path, metavar="YAML", help="its main joint; default: EMIR's joint1.yaml"
    )
    return options


def command(words: Sequence[str]) -> str:
    """Write the file, read it back with Pinocchio, and return what is in it.

    Raises InputError where it cannot be written, ParameterError for a bad sheet.
    """
    options = _parser().parse_args(words)
    require_pinocchio()
    import pinocchio as pin  # noqa: PLC0415 (an extra)

    from emir_plant.robot.dynamics import Mechanics  # noqa: PLC0415 (needs Pinocchio)
    from emir_plant.robot.urdf import urdf  # noqa: PLC0415

    check_outputs([options.file], None, [options.robot, options.machine])
    text = urdf(Mechanics(robot(options.robot, options.machine)))
    write_text(options.file, text + "\n")
    model = pin.buildModelFromUrdf(str(options.file))
    mass = pin.computeTotalMass(model)
    return f"{options.file}: {model.njoints - 1} joints, {mass:.0f} kg, read back by Pinocchio"
