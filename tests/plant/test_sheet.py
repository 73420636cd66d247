"""Parameter files: what is in them, and what is said about a bad one."""

from pathlib import Path

import pytest
import yaml

from emir_common.parameter_tree import declared, with_values
from emir_common.quantity import ParameterError
from emir_plant.effects import Effects
from emir_plant.hydraulics import chambers
from emir_plant.plant import Plant
from emir_plant.sheet import data, even_edges, joint1, load_sheet

FILE = Path(__file__).parents[2] / "emir_plant" / "data" / "joint1.yaml"


def test_every_number_of_the_machine_has_a_source() -> None:
    sheet = load_sheet(FILE, strict=True)
    beside = ("effects.", "unnamed_")  # off unless somebody finds or measures them
    own = {path for path in declared(sheet.machine) if not path.startswith(beside)}
    assert sheet.sources.keys() == own
    assert sheet.machine == joint1()


def test_a_length_written_without_a_point_is_no_whole_number(tmp_path: Path) -> None:
    """A fit moves it by fractions."""
    file = tmp_path / "sheet.yaml"
    text = FILE.read_text()
    assert "boom_mass: {value: 5000.0," in text
    file.write_text(text.replace("boom_mass: {value: 5000.0,", "boom_mass: {value: 5000,"))
    machine = load_sheet(file).machine
    assert machine == joint1()
    moved = with_values(machine, {"geometry.boom_mass": 5000.5})
    assert moved.geometry.boom_mass == 5000.5
    assert isinstance(machine.geometry.boom_mass, float)
    assert isinstance(machine.sensors.resolver_bits, int)


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
        (
            "  beta:",
            "  betta:",
            "cylinder.betta: there is no such parameter; there are area_lifting, area_lowering,",
        ),
        (
            "cylinder:",
            "colour: red\ncylinder:",
            "colour: there is no such parameter; there are geo",
        ),
        ("cylinder:", "cylinder: [", "not YAML"),
        ("cylinder:", "cylinder: {}\ncylinder:", "cylinder stands twice"),
        ("cylinder:", "colour: &it {of: *it}\ncylinder:", "not YAML: found unconstructable recurs"),
        ("beta: {value: 5.0e+8", "beta: {tol: 15%, value: 5.0e+8", "tol = '15%': not a number"),
        ("beta: {value: 5.0e+8", "beta: {tol: , value: 5.0e+8", "tol = None: not a number"),
        ("beta: {value: 5.0e+8", "beta: {tol: 15, value: 5.0e+8", "tol = 15: a relative one"),
        ("beta: {value: 5.0e+8", "beta: {tol: .nan, value: 5.0e+8", "tol = nan: a relative one"),
        ("beta: {value: 5.0e+8", "beta: {tolerance: 1, value: 5.0e+8", "is tol meant?"),
        ("beta: {value: 5.0e+8", "beta: {Tol: 0.1, value: 5.0e+8", "Tol: is tol meant?"),
        ("beta: {value: 5.0e+8, unit", "beta: {value: 5.0e+8, unti", "unti: is unit meant?"),
        ("sections_per_arm: {value: 4", "sections_per_arm: {value: 4.5", "not a whole number"),
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


@pytest.mark.parametrize("written", ["5e8", "50e+7", "5.0e8", "0.5E9", "+.5e9", "500000000"])
def test_a_number_may_be_written_as_ros_and_yaml_1_2_have_it(written: str, tmp_path: Path) -> None:
    file = tmp_path / "machine.yaml"
    text = FILE.read_text()
    assert "beta: {value: 5.0e+8" in text
    file.write_text(text.replace("beta: {value: 5.0e+8", f"beta: {{value: {written}"))
    assert load_sheet(file).machine.cylinder.beta == 5e8


def test_a_missing_parameter_is_named(tmp_path: Path) -> None:
    bad = tmp_path / "machine.yaml"
    lines = [line for line in FILE.read_text().splitlines() if "threshold" not in line]
    bad.write_text("\n".join(lines))
    with pytest.raises(ParameterError, match=r"threshold: missing; allowed is 0 \.\.\. 5e\+07 Pa$"):
        load_sheet(bad)
    with pytest.raises(ParameterError, match="No such file"):
        load_sheet(tmp_path / "none.yaml")


def test_a_file_may_state_only_what_differs_from_another(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(FILE.read_text())
    own = tmp_path / "own.yaml"
    own.write_text(
        "based_on: base.yaml\nsupply: {p0: {value: 3.0e+7, unit: Pa}}\ngeometry: {payload: 100}\n"
        "effects: {viscous_friction: {coefficient: 2.0e+4}}\n"
    )
    changes = {
        "supply.p0": 3e7,
        "geometry.payload": 100.0,
        "effects.viscous_friction.coefficient": 2e4,
    }
    assert load_sheet(own, strict=True).machine == with_values(joint1(), changes)
    own.write_text("based_on: nowhere.yaml\n")
    with pytest.raises(ParameterError, match=r"nowhere.yaml: No such file"):
        load_sheet(own)
    (tmp_path / "base.yaml").write_text("based_on: own.yaml\n")
    own.write_text("based_on: base.yaml\n")
    with pytest.raises(ParameterError, match="is itself based on another"):
        load_sheet(own)


def test_the_other_reading_of_the_valve_changes_what_it_says_and_no_more() -> None:
    sheet = load_sheet(FILE.parent / "joint1_even_edges.yaml", strict=True)
    values = {path: value for path, (_, value) in declared(even_edges()).items()}
    standard = {path: value for path, (_, value) in declared(joint1()).items()}
    changed = {path for path in values if values[path] != standard[path]}
    assert changed == {
        "cylinder.beta",
        "logic_block.threshold",
        "resistances.k_meter_out_lifting",
        "resistances.k_meter_out_lowering",
        "valve.balance_lowering",
        "valve.flow_ratio_lowering",
        "valve.limit_lowering",
    }
    assert changed <= sheet.sources.keys()
    edge = values["valve.balance_pressure"] / values["valve.flow_nominal"] ** 2
    assert values["resistances.k_meter_out_lifting"] == pytest.approx(edge)
    assert values["resistances.k_meter_out_lowering"] == pytest.approx(edge)


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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("? [a]\n: 1\n", "not YAML"),
        ("a: 2024-13-01\n", "not YAML: month must be in 1..12"),
        ("a: !!int x\n", "not YAML"),
        ("a: " + "[" * 2000 + "]" * 2000 + "\n", "not YAML: nested too deep"),
    ],
)
def test_what_the_yaml_library_trips_over_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "odd.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=said) as told:
        load_sheet(file)
    assert "\n" not in str(told.value)


def test_a_fraction_is_not_cut_off_where_a_whole_number_is_wanted() -> None:
    with pytest.raises(ParameterError, match=r"sensors\.resolver_bits = 12\.7: not a whole number"):
        with_values(joint1(), {"sensors.resolver_bits": 12.7})
    assert with_values(joint1(), {"sensors.resolver_bits": 13.0}).sensors.resolver_bits == 13


def test_a_dotted_name_is_its_group_and_name(tmp_path: Path) -> None:
    file = tmp_path / "rig.yaml"
    file.write_text(
        f"based_on: {data('joint1.yaml')}\n"
        "geometry.payload: {value: 900.0, unit: kg, tol: 0.1}\n"
        "effects.coulomb_friction.force: 5000.0\n",
        encoding="utf-8",
    )
    sheet = load_sheet(file)
    assert sheet.machine.geometry.payload == 900.0
    assert sheet.machine.effects.coulomb_friction.force == 5000.0
    assert sheet.tolerances["geometry.payload"] == 0.1


def test_a_number_without_its_group_is_not_dropped(tmp_path: Path) -> None:
    file = tmp_path / "rig.yaml"
    file.write_text(f"based_on: {data('joint1.yaml')}\npayload: 900.0\n", encoding="utf-8")
    with pytest.raises(ParameterError, match=r"payload: is geometry.payload meant"):
        load_sheet(file)
    file.write_text(f"based_on: {data('joint1.yaml')}\nserial: 17\n", encoding="utf-8")
    assert "serial" in load_sheet(file).ignored


@pytest.mark.parametrize("node", ["plant_node", "/plant_node", "/rig/plant_node"])
def test_what_ros_2_dumps_of_the_plant_node_is_a_machine(node: str, tmp_path: Path) -> None:
    machine = with_values(joint1(), {"geometry.payload": 900.0})
    values = {path: value for path, (_, value) in declared(machine).items()}
    told = {path: list(v) if isinstance(v, tuple) else v for path, v in values.items()}
    file = tmp_path / "dump.yaml"
    file.write_text(yaml.safe_dump({node: {"ros__parameters": told}}), encoding="utf-8")
    assert load_sheet(file).machine == machine
