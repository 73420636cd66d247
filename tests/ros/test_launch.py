"""The launch file starts every node that `ros2 run` finds. Stand-ins replace ROS's launch."""

import json
import runpy
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

import pytest

LAUNCH_FILE = Path(__file__).parents[2] / "emir_ros" / "launch" / "emir.launch.py"
EXECUTABLES = LAUNCH_FILE.parents[1] / "executables"


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> MagicMock:
    """Replace every module that the launch file imports; return the stand-in of all names."""
    names = MagicMock()
    names.LaunchConfiguration = lambda name: f"<{name}>"
    names.get_package_share_directory = lambda package: f"/share/{package}"
    for path in (
        "ament_index_python.packages",
        "launch",
        "launch.actions",
        "launch.conditions",
        "launch.substitutions",
        "launch_ros.actions",
        "launch_ros.parameter_descriptions",
    ):
        module = ModuleType(path)
        module.__getattr__ = lambda name: getattr(names, name)  # type: ignore[method-assign]
        monkeypatch.setitem(sys.modules, path, module)
    runpy.run_path(str(LAUNCH_FILE))["generate_launch_description"]()
    return names


def test_every_executable_is_started(launch: MagicMock) -> None:
    started = {
        "".join(call.kwargs["executable"])
        for call in launch.Node.call_args_list
        if call.kwargs["package"] == "emir_ros"
    }
    executables = {path.name for path in EXECUTABLES.glob("*_node")}
    outer = {f"{name}_node" for name in ("cascade", "pfc", "pfc_tip", "lqg", "mpc")}
    beside = {"replay_node", "view_node"}  # for those who look at it
    chosen = {"<controller>_node", "<standby>_node"}
    assert started - chosen | outer | beside == executables
    assert chosen <= started


def _expressions(launch: MagicMock, controller: str, standby: str) -> list[object]:
    """What the launch file's Python expressions are with these two arguments."""
    given = {"<controller>": controller, "<standby>": standby}
    texts = [
        "".join(given.get(word, word) for word in call.args[0])
        for call in launch.PythonExpression.call_args_list
    ]
    return [eval(text, {"__builtins__": {}}) for text in texts]  # noqa: S307 (as launch does)


@pytest.mark.parametrize(
    ("controller", "standby", "nodes"),
    [
        ("cascade", "", {"cascade_node", "force_loop_node"}),
        ("lqg", "", {"lqg_node"}),
        ("pfc_tip", "pfc", {"pfc_tip_node", "pfc_node", "selector_node", "force_loop_node"}),
    ],
)
def test_the_recording_and_the_selector_know_who_runs(
    launch: MagicMock, controller: str, standby: str, nodes: set[str]
) -> None:
    expressions = _expressions(launch, controller, standby)
    (recorded,) = [e for e in expressions if isinstance(e, list) and "plant_node" in e]
    assert set(recorded) == nodes | {"plant_node", "trajectory_node"}
    assert [controller, standby] in expressions  # between whom to choose
    (about,) = [
        call.args[0]
        for call in launch.ParameterValue.call_args_list
        if call.kwargs["value_type"] is str and isinstance(call.args[0], list)
    ]
    told = json.loads("".join(about).replace("<controller>", controller))
    assert told["controller"] == controller


def test_every_configuration_is_a_declared_argument(launch: MagicMock) -> None:
    declared = {call.args[0] for call in launch.DeclareLaunchArgument.call_args_list}
    wanted = {"bag", "controller", "model", "standby", "namespace", "params", "transforms"}
    assert declared == wanted
    used = str([*launch.Node.call_args_list, *launch.IfCondition.call_args_list])
    assert all(f"<{name}>" in used for name in declared)


def test_frames_come_of_the_bent_description(launch: MagicMock) -> None:
    """robot_state_publisher wants a parameter and listens to joint_states."""
    (state_publisher,) = [
        call.kwargs
        for call in launch.Node.call_args_list
        if call.kwargs["package"] == "robot_state_publisher"
    ]
    assert state_publisher["remappings"] == [("joint_states", "description_joint_states")]
    (parameters,) = state_publisher["parameters"]
    assert set(parameters) == {"robot_description"}
    (command,) = launch.Command.call_args_list
    words = "".join(command.args[0]).split()
    assert words[1:4] == ["-P", "-m", "emir_ros.describe"]


def test_parameter_file_is_installed(launch: MagicMock) -> None:
    defaults = {
        call.args[0]: call.kwargs["default_value"]
        for call in launch.DeclareLaunchArgument.call_args_list
    }
    for model in ("joint1", "robot"):
        file = Path("".join(defaults["params"]).replace("<model>", model))
        name = file.relative_to("/share/emir_ros/config")
        assert (LAUNCH_FILE.parents[1] / "config" / name).is_file()
