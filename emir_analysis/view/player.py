"""A recording on the page: play, pause, speed, and a slider to scrub through it."""

import threading
import time

import viser

from emir_analysis.view.frames import Frame
from emir_analysis.view.page import Page

REFRESH = 0.05  # s
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "10")


class Player:
    """Moves through the frames of a recording; the slider is where it stands."""

    def __init__(self, server: viser.ViserServer, page: Page, frames: list[Frame]) -> None:
        self._page, self._frames = page, frames
        start, end = frames[0].time, frames[-1].time
        self._step = (end - start) / (len(frames) - 1)
        gui = server.gui  # these above what the page has put there: negative order
        self.position = gui.add_slider("time / s", start, end, self._step, start, order=-3)
        self.playing = gui.add_checkbox("play", initial_value=False, order=-2)
        self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1", order=-1)
        self._changed = threading.Event()
        for control in (self.position, page.bending):
            control.on_update(lambda _: self._changed.set())
        self._show()

    def run(self, stop: threading.Event) -> None:
        """Follow the controls until `stop` is set."""
        before = time.monotonic()
        while not stop.is_set():
            self._changed.wait(REFRESH)
            now = time.monotonic()
            if self.playing.value:
                self._advance((now - before) * float(self.speed.value))
            before = now
            if self._changed.is_set():
                self._changed.clear()
                self._show()

    def _advance(self, seconds: float) -> None:
        end = self._frames[-1].time
        # viser's setters, which mypy does not see
        self.position.value = min(self.position.value + seconds, end)  # type: ignore[misc]
        self._changed.set()
        if self.position.value >= end:
            self.playing.value = False  # type: ignore[misc]

    def _show(self) -> None:
        start = self._frames[0].time
        index = round((self.position.value - start) / self._step)
        frame = self._frames[min(index, len(self._frames) - 1)]
        self._page.show(frame)
        self._page.plot(self._frames, frame.time)
