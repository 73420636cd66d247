"""`emir run`: start the graph, wait for the machine's run to end, stop it, show its figures."""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.task import Future

from emir_analysis.errors import InputError
from emir_analysis.run_report import analyze, text
from emir_analysis.switching import Switch
from emir_common.parameter_tree import with_values
from emir_common.quantity import ParameterError
from emir_plant.plant import SimulationError
from emir_ros.graph import (
    CONTROLLERS,
    MODELS,
    ROBOT_CONTROLLERS,
    Plan,
    check,
    read_parameters,
    ros_arguments,
    unused,
)
from emir_ros.in_turn import spin_in_turn
from emir_ros.main import (
    make_executor,
    out_of_garbage_collection,
    spin,
    start_ros,
    take_the_rest,
)
from emir_ros.plant_node import PlantNodeParameters
from emir_ros.shell import NodeError, Shell, starting
from emir_ros.start import INTERRUPTED

DEFAULT_TRAJECTORY = "lift-lower"
TRAJECTORIES = "lift-lower, lower-lift, hold; of the robot also line"
GRACE = 10.0  # s that a node has to come up, or to end before it is killed
FIRST_TO_ACT = "trajectory_node"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the graph as the arguments say; returns the exit code."""
    options = _parser().parse_args(arguments)
    plan = Plan(
        bag=options.bag,
        controller=options.controller,
        trajectory=DEFAULT_TRAJECTORY if options.trajectory is None else options.trajectory,
        duration=options.duration,
        params=options.params,
        lockstep=not options.realtime,
        model=options.model,
        namespace=options.namespace.strip("/"),
    )
    try:
        plan = replace(plan, switches=tuple(map(_switch, options.switch)))
        if options.trajectory is None:
            plan = replace(plan, trajectory=_trajectory(plan))
            if options.duration is None:  # the file's is that of its own trajectory
                plan = replace(plan, duration=_duration(plan))
        check(plan)
        not_used = unused(plan)
    except ParameterError as error:
        return _complain(str(error), 1)
    for line in not_used:
        sys.stderr.write(f"emir run: {plan.params}: {line}\n")
    code = run_plan(plan, options.processes)
    if plan.bag.is_dir():  # what there is, however it ended
        shown = _show(plan.bag)
        code = code or shown
    return code


def _trajectory(plan: Plan) -> str:
    """Return the trajectory that the parameter file names, if it names one."""
    own = read_parameters(plan).get("trajectory_node", {})
    return str(own.get("trajectory", plan.trajectory))


def _duration(plan: Plan) -> float | None:
    """Return for how long the parameter file lets the machine run, s; None: it does not say."""
    given = read_parameters(plan).get("plant_node", {})
    wanted = {name: value for name, value in given.items() if name == "duration"}
    try:
        return with_values(PlantNodeParameters(), wanted).duration or None
    except ParameterError as error:
        raise ParameterError(f"{plan.params}: plant_node: {error}") from None


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="emir run",
        description="Start the graph of machine and controllers, record it, stop it when the"
        " machine's run is over, show the figures of the run.",
    )
    parser.add_argument(
        "--model", default="joint1", metavar="NAME", help=f"{', '.join(MODELS)}; default joint1"
    )
    parser.add_argument(
        "--controller", default="cascade", metavar="NAME",
        help=f"{', '.join(CONTROLLERS)} (robot: {', '.join(ROBOT_CONTROLLERS)});"
        " default cascade",
    )  # fmt: skip
    parser.add_argument(
        "--switch", action="append", default=[], metavar="S=NAME",
        help="at S seconds to the controller NAME, while the machine moves; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--trajectory", metavar="NAME",
        help=f"{TRAJECTORIES}; default: that of --params, or lift-lower",
    )  # fmt: skip
    parser.add_argument(
        "--duration", type=float, metavar="S",
        help="simulated time; default: that of --params, or as long as the trajectory takes",
    )  # fmt: skip
    parser.add_argument(
        "--params", type=Path, metavar="FILE", help="ROS 2 parameter file of the nodes"
    )
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument("--realtime", action="store_true", help="as fast as the clock on the wall")
    pace.add_argument(
        "--lockstep", action="store_true",
        help="as fast as it goes, the same recording every time (default)",
    )  # fmt: skip
    parser.add_argument(
        "--processes", choices=("one", "many"), default="one",
        help="all nodes in one process (default), or each in its own",
    )  # fmt: skip
    parser.add_argument(
        "--namespace", default="", metavar="NAME", help="of all nodes and topics; default: none"
    )
    parser.add_argument(
        "--bag", type=Path, required=True, metavar="DIR",
        help="folder of the recording; must not exist",
    )  # fmt: skip
    return parser


def _switch(words: str) -> Switch:
    time, equals, name = words.partition("=")
    try:
        return Switch(float(time), name.strip() if equals else "")
    except ValueError:
        raise ParameterError(f"--switch {words}: not of the form S=NAME") from None


def run_plan(plan: Plan, processes: str) -> int:
    """Run the graph in `one` process or in `many`; returns the exit code.

    The recording is closed when this returns.
    """
    try:
        with ros_arguments(plan) as ros:
            if processes == "one":
                _run_in_one_process(plan, ros)
            else:
                _run_in_many_processes(plan, ros)
    except (KeyboardInterrupt, ExternalShutdownException):
        return _complain("interrupted", INTERRUPTED)
    except ParameterError as error:
        where = f"{plan.params}: " if plan.params else ""
        return _complain(f"{where}{error}", 1)
    except (NodeError, SimulationError) as error:
        return _complain(str(error), 1)
    return 0


def _run_in_one_process(plan: Plan, ros: list[str]) -> None:
    with starting():
        stop = start_ros()
    nodes: dict[str, Shell] = {}
    ended = Future()
    try:
        with make_executor() as executor:
            for name in plan.nodes:
                with starting():
                    nodes[name] = _node_class(name)(ros)
                nodes[name].ended.add_done_callback(lambda _: ended.set_result(None))
            recorder, *loops, plant = nodes.values()
            if plan.lockstep:
                spin_in_turn(executor, [plant, *loops, recorder], ended, stop)
            else:
                for node in nodes.values():
                    executor.add_node(node)
                with out_of_garbage_collection():
                    spin(executor, plant, ended, stop)
            for node in nodes.values():
                node.check()
            take_the_rest(executor, *nodes.values())
    finally:
        with ExitStack() as ending:  # all of it, whatever fails; the last one first
            # nobody looks at `stop` any more
            ending.callback(signal.signal, signal.SIGTERM, signal.SIG_DFL)
            ending.callback(signal.signal, signal.SIGINT, signal.default_int_handler)
            ending.callback(rclpy.try_shutdown)
            for node in reversed(nodes.values()):
                ending.callback(node.destroy_node)
                ending.callback(node.close)
    if stop.made:  # while it ended by itself: whoever called has more to do
        raise KeyboardInterrupt


def _node_class(name: str) -> Callable[[list[str]], Shell]:
    module = import_module(f"emir_ros.{name}")
    kind: Callable[[list[str]], Shell] = getattr(module, name.title().replace("_", ""))
    return kind


def _run_in_many_processes(plan: Plan, ros: list[str]) -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    processes: dict[str, subprocess.Popen[bytes]] = {}
    try:
        for name in sorted(plan.nodes, key=lambda name: name == FIRST_TO_ACT):
            if name == FIRST_TO_ACT and not plan.lockstep:
                _wait_for_nodes(processes)
            command = [sys.executable, "-P", "-m", "emir_ros.start", name, *ros]
            processes[name] = subprocess.Popen(command)  # noqa: S603 (our own nodes)
        _wait_for_plant(processes)
    finally:
        with _deaf_to_signals():  # or a second one would leave nodes behind
            recorder = processes.pop("recorder_node", None)
            _stop(processes.values())
            if recorder is not None:  # the last one, since it hears all the others
                _stop([recorder])


@contextmanager
def _deaf_to_signals() -> Iterator[None]:
    numbers = (signal.SIGINT, signal.SIGTERM)
    former = [signal.signal(number, signal.SIG_IGN) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, former, strict=True):
            signal.signal(number, handler)


def _wait_for_nodes(processes: dict[str, subprocess.Popen[bytes]]) -> None:
    """Return when all are there, after GRACE at most, or when one has ended: that is told of then.

    In real time the first move begins a second after the trajectory does: who comes up later than
    that, as it loads more, would miss it.
    """
    context, until = rclpy.Context(), time.monotonic() + GRACE
    rclpy.init(context=context)
    node = rclpy.create_node("emir_run", context=context)
    try:
        while time.monotonic() < until and not processes.keys() <= set(node.get_node_names()):
            if any(process.poll() is not None for process in processes.values()):
                break
            time.sleep(0.02)
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


def _wait_for_plant(processes: dict[str, subprocess.Popen[bytes]]) -> None:
    """Return when the plant has run to its end; raises NodeError when a node died before."""
    while True:
        for name, process in processes.items():
            code = process.poll()
            if code is None:
                continue
            if name == "plant_node" and code == 0:
                return
            how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended ({code})"
            raise NodeError(f"{name} {how} before the run was over")
        time.sleep(0.02)


def _stop(processes: Collection[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        process.send_signal(signal.SIGINT)
    for process in processes:
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _show(bag: Path) -> int:
    try:
        print(text(analyze(bag)), flush=True)  # noqa: T201 (a command prints)
    except InputError as error:
        return _complain(str(error), 1)
    except BrokenPipeError:  # whoever read our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def _complain(message: str, code: int) -> int:
    sys.stderr.write(f"emir run: {message}\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
