"""A report is one file that needs nothing else and shows text as text."""

import base64
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from emir_analysis.errors import InputError
from emir_analysis.report import Heading, Picture, Table, Text, new_figure, write_html


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.links: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in {"src", "href"}]

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_report_is_self_contained_and_escaped(tmp_path: Path) -> None:
    figure = new_figure(2.0)
    figure.subplots().plot([0.0, 1.0])
    nasty = '<script>alert("1 & 2")</script>'
    blocks = [
        Heading(nasty),
        Text(nasty, lead=True),
        Table(("name", "value"), [(nasty, 1.23456)], nasty),
        Picture(figure, nasty),
    ]
    write_html(tmp_path / "report.html", nasty, blocks)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    reader = _Reader()
    reader.feed(page)
    assert "script" not in reader.tags
    assert reader.text.count(nasty) == 7  # title twice, and once for each place above
    assert "1.23" in reader.text
    assert all(link.startswith("data:image/png;base64,") for link in reader.links)
    (picture,) = re.findall(r"base64,([^\"]+)", page)
    assert base64.b64decode(picture).startswith(b"\x89PNG")


def test_a_report_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        write_html(tmp_path / "nowhere" / "report.html", "title", [])
