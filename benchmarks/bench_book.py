"""The book, opened from the disk: time until the browser paints something of a chapter.

It is the median of several visits in one process of Chromium, the first not counted.  Asked are two
seconds.  `make book` makes the book and installs Playwright; without either there is no row.
"""

import importlib.util
import shutil
import statistics

from benchmarks.timing import Row
from tbdcore.repro import paths

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
CHAPTERS = sorted((paths.build() / "book" / "notebooks").glob("*.html"))
VISITS = 6
FIRST = "Math.min(...performance.getEntriesByType('paint').map(entry => entry.startTime))"


def first_paint(browser, chapter):
    """Seconds from the start of the visit to the first paint."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(chapter.as_uri())
    page.wait_for_function("performance.getEntriesByType('paint').length")
    milliseconds = page.evaluate(FIRST)
    page.close()
    return milliseconds / 1e3


def rows():
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if not (CHAPTERS and found and importlib.util.find_spec("playwright")):
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=found, args=["--no-sandbox"])
        for chapter in CHAPTERS:
            visits = [first_paint(browser, chapter) for _ in range(VISITS)][1:]
            yield Row("first paint", chapter.stem, statistics.median(visits), asked_seconds=2.0)
        browser.close()
