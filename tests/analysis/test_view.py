"""`emir view`: the numbers on the page against the recording, and the page in a browser."""

import math
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import page

pytest.importorskip("viser", reason="needs the extra `view`")

from playwright.sync_api import Page

from emir_analysis.cli import main
from emir_analysis.run_signals import load_run
from emir_analysis.view.arm import Outline, centreline, cylinder
from emir_analysis.view.frames import Frame, frames, tcp_deflection
from emir_analysis.view.page import span, table
from emir_analysis.view.robot import JOINTS, SIGNALS, bent_line, robot_frame
from emir_analysis.view.robot import centreline as robot_centreline
from emir_analysis.view.subject import robot_subject, subject_of_joint1
from emir_control.arm import Arm
from emir_plant.plant import Plant
from emir_plant.sheet import joint1

LIFT = Path(__file__).parents[2] / "bags" / "lift"
OUTLINE = Outline(boom=22.5, triangle_a=2.0, triangle_b=0.65, triangle_gamma0=math.radians(40.0))


@pytest.mark.parametrize("angle", [0.0, 0.7, 1.4])
def test_the_boom_starts_at_the_joint_and_ends_at_the_tcp(angle: float) -> None:
    points = centreline(OUTLINE, angle, -0.18)
    along = np.array([math.cos(angle), 0.0, math.sin(angle)])
    up = np.array([-math.sin(angle), 0.0, math.cos(angle)])
    assert np.allclose(points[0], 0.0)
    assert np.allclose(points[-1], 22.5 * along - 0.18 * up)
    first = points[1] - points[0]
    assert first @ up == pytest.approx(0.0, abs=2e-3)  # clamped at the joint


def test_the_cylinder_is_as_long_as_the_linkage_says() -> None:
    """Its length grows by the stroke of the machine's own linkage."""

    def length(angle: float) -> float:
        return float(np.linalg.norm(np.subtract(*cylinder(subject_of_joint1().outline, angle))))

    plant = Plant(joint1())
    stroke = plant.outputs(plant.initial(0.9)).stroke
    assert length(0.9) - length(0.0) == pytest.approx(stroke, abs=1e-9)


def test_a_strain_gauge_shows_the_static_deflection() -> None:
    """At rest at 45 deg five modes, whose angle it is, sag 16.2 cm of the boom's 17.7 cm."""
    plant = Plant(joint1())
    truth = plant.outputs(plant.initial(math.radians(45.0)))
    shown = tcp_deflection(truth.tip_angle - truth.angle, 22.5)
    assert shown == pytest.approx(-0.162, abs=1e-3)


def test_frames_hold_what_was_recorded() -> None:
    run = load_run(LIFT)
    shown = frames(run, 22.5)
    assert [f.time for f in shown] == list(run["stroke"].time)
    assert [f.stroke for f in shown] == list(run["true_stroke"].value)
    command = run["valve_command"]
    assert {f.valve_command for f in shown} == set(command.value)  # held, nothing in between
    nothing = Frame(1.0, *(math.nan for _ in Frame._fields[1:]))
    shown_numbers = table(subject_of_joint1().readings(nothing))
    assert shown_numbers.count(" - ") == len(Frame._fields) - 1


@pytest.mark.parametrize("angles", [(0.3, 0.8, -0.2, -0.2, -0.3, -0.3), (-2.0, 1.2, 0, -1, 0, 0)])
def test_the_robots_arms_end_where_the_controllers_geometry_has_the_tcp(
    angles: tuple[float, ...],
) -> None:
    subject, joints = robot_subject(), np.array(angles)
    line = robot_centreline(subject.arm, joints)
    assert np.allclose(line[0], [0.0, 0.0, subject.arm.height])
    tcp = Arm(replace(subject.arm, sag=0)).tcp(joints)[:3]
    assert np.allclose(line[-1], tcp)
    pieces = np.linalg.norm(np.diff(line, axis=0), axis=1)
    assert pieces.sum() == pytest.approx(22.5)  # paper 1
    bent = bent_line(line, np.array([0.1, 0.0, -0.2]))
    assert np.allclose(bent[0], line[0])
    assert np.allclose(bent[-1] - tcp, [0.1, 0.0, -0.2])


def test_a_robots_frame_knows_how_far_each_joint_is_off() -> None:
    given = {name: float(k) for k, name in enumerate(SIGNALS)}
    shown = robot_frame(1.5, given)
    for joint in JOINTS:
        wanted = given[f"{joint}_stroke"] - given[f"{joint}_reference_stroke"]
        assert getattr(shown, f"{joint}_error") == wanted
    missing = table(robot_subject().readings(robot_frame(1.5, {})))
    assert missing.count(" - ") == len(JOINTS) + 3  # angles and the TCP's place


@pytest.fixture
def address() -> Iterator[str]:
    """A recording's page, served as users do it, and stopped as they do it."""
    command = [sys.executable, "-m", "emir_analysis.cli", "view", "--bag", str(LIFT)]
    with subprocess.Popen(
        [*command, "--port", "8471"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        said = (re.search(r"http://localhost:\d+", line) for line in process.stdout)
        found = next(filter(None, said), None)
        assert found is not None, process.communicate()
        yield found.group()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 0
    assert "Traceback" not in errors


def _cell(view: Page, name: str) -> float:
    row = view.locator("tr", has_text=name).first
    return float(row.locator("td").nth(1).inner_text())


def test_scrubbing_shows_the_recording(address: str) -> None:
    shown = frames(load_run(LIFT), 22.5)
    with page() as view:
        view.goto(address)
        view.locator("tr", has_text="stroke").first.wait_for()
        assert _cell(view, "stroke") == pytest.approx(shown[0].stroke * 1e3, abs=0.06)
        assert view.locator("canvas").count() >= 5  # the arm and four plots
        entry = view.locator("input[type=text]").first  # beside the slider of the time
        entry.fill("2.4")
        entry.press("Enter")
        view.locator("td", has_text=re.compile(r"^2\.40$")).wait_for()
        frame = shown[300]
        assert _cell(view, "joint angle") == pytest.approx(math.degrees(frame.angle), abs=0.006)
        assert _cell(view, "TCP deflection") == pytest.approx(
            frame.tcp_deflection * 100.0, abs=0.006
        )
        view.get_by_text("play", exact=True).click()
        view.locator("td", has_text=re.compile(r"^3\.20$")).wait_for()  # to the end
        assert _cell(view, "stroke") == pytest.approx(shown[-1].stroke * 1e3, abs=0.06)


def test_a_plots_height_is_that_of_what_is_known() -> None:
    """A signal that begins late, or never comes, hides no other one."""
    late, never = np.array([math.nan, 3.0, 5.0]), np.full(3, math.nan)
    low, high = span([late, never, np.array([1.0, 2.0, 3.0])])
    assert 0.5 < low < 1.0
    assert 5.0 < high < 5.5
    low, high = span([np.full(3, 2.0)])
    assert low < 2.0 < high
    low, high = span([never])
    assert low < high


def test_bad_input_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "--bag", "nowhere"]) == 1
    assert capsys.readouterr().err == "emir view: nowhere: no such recording\n"
    assert main(["view", "--bag", str(LIFT), "--port", "70000"]) == 1
    assert "--port 70000" in capsys.readouterr().err
    assert main(["view", "--bag", str(LIFT), "--model", "robot"]) == 1
    assert "--model is for --live" in capsys.readouterr().err
