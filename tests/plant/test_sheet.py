"""Parameter files: what is in them, and what is said about a bad one."""

from pathlib import Path

import pytest

from emir_common.parameter_tree import declared
from emir_common.quantity import ParameterError
from emir_plant.effects import Effects
from emir_plant.hydraulics import chambers
from emir_plant.plant import Plant
from emir_plant.sheet import joint1, load_sheet

FILE = Path(__file__).parents[2] / "emir_plant" / "data" / "joint1.yaml"


def test_every_number_of_the_machine_has_a_source() -> None:
    sheet = load_sheet(FILE, strict=True)
    own = {path for path in declared(sheet.machine) if not path.startswith("effects.")}
    assert sheet.sources.keys() == own
    assert sheet.machine == joint1()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("beta: {value: 5.0e+8", "beta: {value: 5.0e+12", "cylinder.beta = 5e+12: outside 1e"),
        ("beta: {value: 5.0e+8", "beta: {value: .nan", "cylinder.beta = nan: outside 1e"),
        ("beta: {value: 5.0e+8", "beta: {value: soft", "cylinder.beta = 'soft': not a number"),
        (
            "beta: {value: 5.0e+8, unit: Pa",
            "beta: {value: 5.0e+3, unit: bar",
            "in bar, expected Pa",
        ),
        ("  beta:", "  betta:", "cylinder.betta: there is no such parameter"),
        ("cylinder:", "cylinder: [", "not YAML"),
    ],
)
def test_a_bad_file_is_told_in_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    bad = tmp_path / "machine.yaml"
    text = FILE.read_text()
    assert old in text
    bad.write_text(text.replace(old, new))
    with pytest.raises(ParameterError) as error:
        load_sheet(bad, strict=True)
    message = str(error.value)
    assert said in message
    assert message.startswith(str(bad))
    assert "\n" not in message


def test_a_missing_parameter_is_named(tmp_path: Path) -> None:
    bad = tmp_path / "machine.yaml"
    lines = [line for line in FILE.read_text().splitlines() if "threshold" not in line]
    bad.write_text("\n".join(lines))
    with pytest.raises(ParameterError, match=r"logic_block.threshold: missing"):
        load_sheet(bad)
    with pytest.raises(ParameterError, match="No such file"):
        load_sheet(tmp_path / "none.yaml")


def test_the_data_sheet_is_read_with_its_tolerances(shared: Path) -> None:
    sheet = load_sheet(shared / "recordings" / "datasheet.yaml")
    assert sheet.tolerances["cylinder.beta"] == 0.15
    assert sheet.tolerances["geometry.modal_frequency"] == 0.02
    assert sheet.machine.sensors.resolver_bits == 12
    assert sheet.machine.geometry.modal_frequency == 1.0


def test_what_the_data_sheet_does_not_mention_is_not_there(shared: Path) -> None:
    sheet = load_sheet(shared / "recordings" / "datasheet.yaml")
    assert sheet.machine.effects == Effects()
    assert sheet.machine.logic_block.pilot == 0  # "threshold ... on p_H"
    assert chambers.relief_flow(1e8, Plant(sheet.machine).record[0]) == 0.0
