"""What a node's module loads: parts of SciPy take up to a second each, so those it needs alone."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

import emir_ros

PLANNERS = {"lqg_node": "optimize", "mpc_node": "optimize"}
NODES = {path.stem for path in Path(emir_ros.__file__).parent.glob("*_node.py")}
LOAD = """
import sys
from importlib import import_module

for name in sys.argv[1:]:
    import_module(f"emir_ros.{name}")
parts = {name.split(".")[1] for name in sys.modules if name.startswith("scipy.")}
print(*sorted(part for part in parts if not part.startswith("_") and part != "version"))
"""
COMPILER = """
import sys
from importlib import import_module

for name in sys.argv[1:]:
    import_module(f"emir_ros.{name}")
print("numba" in sys.modules)
import_module("emir_plant.jit").square_root(2.0)
print("numba" in sys.modules)
"""
MAKE = """
import sys

import rclpy

from emir_ros.trajectory_node import TrajectoryNode

rclpy.init()
node = TrajectoryNode(["--ros-args", "-p", sys.argv[1]])
print("scipy.interpolate" in sys.modules)
"""


def _parts_of_scipy(nodes: list[str]) -> list[str]:
    return _printed(LOAD, *nodes).split()


def _printed(program: str, *words: str) -> str:
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_no_part_of_scipy_is_loaded_before_it_is_needed() -> None:
    others = sorted(NODES - PLANNERS.keys())
    assert len(others) > len(PLANNERS)
    assert _parts_of_scipy(others) == []


def test_the_compiler_is_loaded_by_who_computes_with_the_machine() -> None:
    """numba takes half a second and 60 MB, which no controller needs."""
    assert _printed(COMPILER, *sorted(NODES)).split() == ["False", "True"]


@pytest.mark.parametrize("node", PLANNERS)
def test_what_plans_while_the_machine_moves_is_loaded_by_then(node: str) -> None:
    """Loading it within a control period would leave the machine without commands for many."""
    assert PLANNERS[node] in _parts_of_scipy([node])


@pytest.mark.parametrize(("lockstep", "loaded"), [("false", "True"), ("true", "False")])
@pytest.mark.usefixtures("ros_domain")
def test_what_an_order_takes_is_loaded_by_then_in_real_time(lockstep: str, loaded: str) -> None:
    """In lock step time stands still meanwhile, and most runs have no order."""
    assert _printed(MAKE, f"lockstep:={lockstep}").strip() == loaded
