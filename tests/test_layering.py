"""Which package may import which, and that all but emir_ros does without ROS."""

import ast
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

MAY_IMPORT = {
    "emir_common": set(),
    "emir_plant": {"emir_common"},
    "emir_control": {"emir_common"},
    "emir_msgs_py": {"emir_common"},
    "emir_analysis": {"emir_common", "emir_plant", "emir_control", "emir_msgs_py"},
    "emir_ros": {"emir_common", "emir_plant", "emir_control", "emir_msgs_py", "emir_analysis"},
}
WITHOUT_ROS = sorted(MAY_IMPORT.keys() - {"emir_ros"})
ROS_MODULES = [
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
]

EXTRAS = {"pinocchio": "robot", "viser": "view"}  # imported by modules that nobody needs without

IMPORT_ALL_AND_STEP = """
import pkgutil, sys
from importlib import import_module

ros, packages, extras = (argument.split() for argument in sys.argv[1:])
sys.modules.update(dict.fromkeys(ros))  # None there makes an import of it fail
for package in packages:
    folder = import_module(package).__path__
    for module in pkgutil.walk_packages(folder, f"{package}.", onerror=import_module):
        try:
            import_module(module.name)
        except ModuleNotFoundError as error:
            if error.name not in extras:
                raise
            print(error.name, module.name)

from emir_plant.plant import Plant
from emir_plant.sheet import joint1

plant = Plant(joint1())
state, truth = plant.step(plant.initial(0.8, 2e6), 0.1, 0.008)
print(f"stroke {truth.stroke:.3f} m")
"""


def _folder(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    assert spec is not None, f"{package} is not there"
    assert spec.submodule_search_locations, f"{package} is not a package"
    return Path(spec.submodule_search_locations[0])


def _imports(source: str) -> set[str]:
    """Return the top-level packages that a source text imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(str(node.module).split(".")[0])
    return found


def test_imports_are_found_wherever_they_stand() -> None:
    source = "import emir_a.b\nfrom . import c\ndef f():\n    from emir_d.e import g"
    assert _imports(source) == {"emir_a", "emir_d"}


def test_every_package_has_a_place() -> None:
    installed = {path.parent.name for path in _folder("emir_plant").parent.glob("emir_*/*.py")}
    assert installed == MAY_IMPORT.keys()


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_go_one_way(package: str) -> None:
    forbidden = MAY_IMPORT.keys() - MAY_IMPORT[package] - {package}
    sources = sorted(_folder(package).rglob("*.py"))
    assert sources
    wrong = {
        f"{path.relative_to(_folder(package).parent)} imports {name}"
        for path in sources
        for name in _imports(path.read_text()) & forbidden
    }
    assert not wrong


def _import_all(without: list[str], packages: list[str]) -> subprocess.CompletedProcess[str]:
    """Import every module where some cannot be, and let the machine take a step."""
    words = (" ".join(names) for names in (without, packages, EXTRAS))
    return subprocess.run(
        [sys.executable, "-c", IMPORT_ALL_AND_STEP, *words],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"MPLBACKEND": "agg"},
    )


def test_all_but_emir_ros_runs_without_ros() -> None:
    result = _import_all(ROS_MODULES, WITHOUT_ROS)
    assert result.returncode == 0, result.stderr
    *left_out, last = result.stdout.splitlines()
    assert last.startswith("stroke ")
    missing = dict(line.split() for line in left_out)  # the last module that needs it
    if missing:
        needed = (f"{m} and others need '.[{EXTRAS[name]}]'" for name, m in missing.items())
        pytest.skip(f"the rest is right, but not tried: {'; '.join(needed)}")


@pytest.mark.parametrize("extra", EXTRAS)
def test_where_an_extra_is_missing_the_rest_runs(extra: str) -> None:
    result = _import_all([extra, *ROS_MODULES], WITHOUT_ROS)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1].startswith("stroke ")
    assert f"{extra} emir_" in result.stdout


def test_the_block_against_ros_holds() -> None:
    assert _import_all(ROS_MODULES, ["rclpy"]).returncode != 0
