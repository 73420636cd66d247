"""The report of a run, looked at in a browser: its plots draw, zoom and hold the signals."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from browser import page

from emir_analysis.cli import main
from emir_analysis.run_plots import MOTION
from emir_analysis.run_signals import load_run

LIFT = Path(__file__).parents[2] / "bags" / "lift"
RANGE = "() => document.getElementById('plot0').layout.xaxis.range.map(Number)"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("report") / "report.html"
    assert main(["analyze", str(LIFT), "--html", str(file)]) == 0
    return file


def test_the_plots_show_the_signals_and_zoom_together(report: Path) -> None:
    with page() as view:
        requests: list[str] = []
        view.on("request", lambda request: requests.append(request.url))
        view.goto(report.as_uri())
        view.wait_for_selector("#plot1 .main-svg")
        assert all(url.startswith(("file:", "data:", "blob:")) for url in requests)
        drawn = view.evaluate("() => document.querySelectorAll('.scatterlayer .js-line').length")
        assert drawn == 5 + 4  # the paper's Fig. 9, and the hydraulics
        piston = view.evaluate("() => Array.from(document.getElementById('plot0')._fullData[1].y)")
        stroke = load_run(LIFT)["true_stroke"].value
        assert np.allclose(piston, stroke * 1e3, rtol=1e-6)
        before = view.evaluate(RANGE)
        box = view.locator("#plot0 .nsewdrag").first.bounding_box()
        assert box is not None
        middle = box["y"] + box["height"] / 2
        view.mouse.move(box["x"] + 0.25 * box["width"], middle)
        view.mouse.down()
        view.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=5)
        view.mouse.up()
        after = view.evaluate(RANGE)
        span = before[1] - before[0]
        assert after == pytest.approx(
            [before[0] + 0.25 * span, before[0] + 0.5 * span], abs=0.02 * span
        )
        lowest = view.evaluate(
            "() => document.getElementById('plot0').layout.xaxis3.range.map(Number)"
        )
        assert lowest == after


def test_two_runs_share_the_plots(tmp_path: Path) -> None:
    file = tmp_path / "both.html"
    shutil.copytree(LIFT, tmp_path / "again")
    assert main(["analyze", str(LIFT), str(tmp_path / "again"), "--html", str(file)]) == 0
    with page() as view:
        view.goto(file.as_uri())
        view.wait_for_selector("#plot1 .main-svg")
        names = view.evaluate(
            "() => document.getElementById('plot0')._fullData.map(trace => trace.name)"
        )
    alone = [line.label for row in MOTION for line in row.lines]
    assert names == [f"{run}: {label}" for run in ("lift", "again") for label in alone]
