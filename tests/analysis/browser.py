"""A real browser for pages that people look at: Chromium as the system has it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
QUIET = (  # it looks for its maker's hosts otherwise
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
PATIENCE = 120_000.0  # ms, on a busy computer


@contextmanager
def page(width: int = 1200, height: int = 900) -> Iterator[Page]:
    """Yield an empty page; skip the test where there is no browser; fail on a script's error."""
    path = next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(QUIET))
        view = browser.new_page(viewport={"width": width, "height": height})
        view.set_default_timeout(PATIENCE)
        errors: list[str] = []
        view.on("pageerror", lambda error: errors.append(str(error)))
        yield view
        browser.close()
    assert not errors
