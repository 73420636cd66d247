"""Independent fits side by side: in their order, at the same time, and what fails says so."""

from threading import Barrier

import numba
import pytest

from emir_analysis.diagnosis.side_by_side import side_by_side


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba, "get_num_threads", lambda: 2)


def test_results_come_in_the_order_of_the_items() -> None:
    """The second one ends first: the first waits for it."""
    ended = Barrier(2, timeout=60.0)
    order = []

    def work(name: str) -> str:
        if name == "second":
            order.append(name)
            ended.wait()
        else:
            ended.wait()
            order.append(name)
        return name.upper()

    assert side_by_side(work, ["first", "second"]) == ["FIRST", "SECOND"]
    assert order == ["second", "first"]


def test_nothing_to_do_is_no_result() -> None:
    """As a round has none that knows no effect more."""
    assert side_by_side(str, []) == []


def test_what_fails_is_raised() -> None:
    """A machine that cannot be simulated ends the diagnosis in one line, not in a hole."""

    def work(k: int) -> int:
        if k == 1:
            raise ValueError("the second one")
        return k

    with pytest.raises(ValueError, match="the second one"):
        side_by_side(work, range(3))
