"""The book in a real browser, as a reader opens it: from the disk, without a network.

`make book` builds it and installs what these tests need.  The browser is Chromium from the system's
packages (Debian, Ubuntu: apt-get install chromium); without one, its tests are skipped.
"""

import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import parse_qsl, unquote, urlsplit

import pytest

from benchmarks.bench_book import BROWSERS
from tbdcore.repro import cite, claims, clone, pages, paths, scorecard

pytest.importorskip("playwright", reason="needs docs/environment.txt; run: make book")

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect, sync_playwright

from docs import book

BOOK = paths.build() / "book"
LOCK = paths.root() / "docs" / "environment.txt"
PAGES = sorted(str(file.relative_to(BOOK)) for file in BOOK.rglob("*.html"))
PAGES = [page for page in PAGES if not page.startswith("_")]
if not PAGES:
    pytest.skip("there is no book; run: make book", allow_module_level=True)
CHAPTERS = [page for page in PAGES if page.startswith("notebooks/")]
WIDTHS = (390, 1280)
SERIOUS = ("serious", "critical")
# what a reader would see of a page that is not whole
FAULTS = r"""async () => {
  await window.MathJax?.startup?.promise;
  const every = words => [...document.querySelectorAll(words)];
  const wide = every("pre").filter(e => e.scrollWidth > e.clientWidth &&
    Math.max(...e.textContent.split("\n").map(line => line.length)) <= 100);
  return {
    images: every("img").filter(e => e.complete && !e.naturalWidth).map(e => e.src),
    unset: every(".math").filter(e => !e.querySelector("mjx-container")).map(e => e.textContent),
    errors: every("mjx-merror, [data-mjx-error]").map(e => e.textContent),
    scrolls: document.documentElement.scrollWidth - document.documentElement.clientWidth,
    wide: innerWidth < 1000 ? [] : wide.map(e => e.textContent.slice(0, 90)),
  };
}"""
# words that are broken in their middle though they fit their box
BROKEN = r"""() => {
  const found = [], page = document.querySelector("article") ?? document.body;
  const walk = document.createTreeWalker(page, NodeFilter.SHOW_TEXT);
  const boxes = (node, start, text) => {
    const range = document.createRange();
    range.setStart(node, start);
    range.setEnd(node, start + text.length);
    return [...range.getClientRects()].filter(box => box.width);
  };
  for (let node; (node = walk.nextNode()); ) {
    if (node.parentElement.closest("pre, mjx-container, script, .dt-container")) continue;
    const box = node.parentElement.closest("td, th, p, li, h1, h2, h3, figcaption, div");
    for (const part of node.data.matchAll(/\S+/g)) {
      const whole = boxes(node, part.index, part[0]);
      const width = whole.reduce((sum, each) => sum + each.width, 0);
      if (whole.length < 2 || width > 0.9 * box.clientWidth) continue;
      for (const word of part[0].matchAll(/[\p{Script=Latin}\d_]{4,}/gu)) {
        const own = boxes(node, part.index + word.index, word[0]);
        if (new Set(own.map(box => Math.round(box.top))).size > 1) found.push(word[0]);
      }
    }
  }
  return found;
}"""
# on a page opened narrow: how many elements show other colours or letters there than now
LOOKS = r"""() => {
  const looks = new Map();
  for (const e of document.querySelectorAll("*")) {
    const s = getComputedStyle(e);
    const ground = [s.backgroundColor, s.backgroundImage, s.opacity];
    const look = [s.color, s.fontSize, s.fontWeight, ...ground].join();
    looks.set(e, e.checkVisibility() ? look : "");
  }
  window.narrow ??= looks;
  const changed = [...window.narrow].filter(([e, look]) => look && look !== looks.get(e));
  changed.forEach(([e]) => (e.dataset.narrow = ""));
  return changed.length;
}"""
TOTAL = "article tbody tr:last-child"
SOUND = {"images": [], "unset": [], "errors": [], "scrolls": 0, "wide": []}
expect.set_options(timeout=30_000)  # milliseconds, as all other waits: a busy machine is no fault


@pytest.fixture(scope="module")
def browser():
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if not found:
        pytest.skip("no Chromium; install it (Debian, Ubuntu: apt-get install chromium)")
    with sync_playwright() as play:
        yield play.chromium.launch(executable_path=found, args=["--no-sandbox"])


@pytest.fixture
def open_page(browser):
    """Opens a page of the book at a width; every complaint of the browser fails the test."""
    said = []
    context = browser.new_context()

    def opened(name, width=1280):
        page = context.new_page()
        page.set_viewport_size({"width": width, "height": 800})
        page.on("console", lambda m: said.append(m.text) if m.type in ("error", "warning") else 0)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("requestfailed", lambda request: said.append(f"failed: {request.url[:200]}"))
        page.on("request", lambda request: said.append(request.url) if elsewhere(request) else 0)
        page.goto(f"{BOOK.as_uri()}/{name}")
        return page

    yield opened
    context.close()
    assert not said


def elsewhere(request):
    return not request.url.startswith((BOOK.as_uri(), "data:", "blob:"))


# Every page ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_whole_and_accessible(open_page, name):
    assert (BOOK / name).stat().st_size <= 3e6
    assert_sound(open_page(name, WIDTHS[0]))


def test_a_colour_that_is_too_pale_on_a_narrow_page_only_is_found(open_page):
    page = open_page("genindex.html", WIDTHS[0])
    page.add_style_tag(content="@media (max-width: 600px) { h1 { color: #bbb !important } }")
    with pytest.raises(AssertionError, match="color-contrast"):
        assert_sound(page)


def assert_sound(page):
    """That a page that was opened narrow has no fault at either width."""
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate(FAULTS) == SOUND, width
        assert page.evaluate(BROKEN) == [], width
        changed = page.evaluate(LOOKS)
    assert not inaccessible(page)
    if changed:  # all else has the contrast that has just been found good
        page.set_viewport_size({"width": WIDTHS[0], "height": 800})
        assert not inaccessible(page, ["color-contrast"], "[data-narrow]")


def inaccessible(page, rules=(), where="html"):
    """Serious faults that axe finds on a page, by rule; of some rules and elements, or of all."""
    options = {"preload": False, "resultTypes": ["violations"]}
    options |= {"runOnly": {"type": "rule", "values": [*rules]}} if rules else {}
    found = Axe().run(page, where, options).response["violations"]
    bad = [rule for rule in found if rule["impact"] in SERIOUS or rule["id"] == "heading-order"]
    return {rule["id"]: [node["html"][:120] for node in rule["nodes"][:3]] for rule in bad}


@pytest.mark.parametrize("name", ["index.html", "claims.html", "gallery.html", *CHAPTERS[1:2]])
def test_a_dark_page_is_accessible(open_page, name):
    page = open_page(name)
    page.evaluate("document.documentElement.dataset.theme = 'dark'")
    page.evaluate("Promise.allSettled(document.getAnimations().map(fade => fade.finished))")
    assert not inaccessible(page)


class Links(HTMLParser):
    """Identifiers of a page, and where its links and pictures lead."""

    def __init__(self, file):
        super().__init__()
        self.ids, self.links, self.words = set(), [], []
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        known = dict(attributes)
        self.ids.add(known.get("id"))
        self.links += [known[name] for name in ("href", "src") if known.get(name)]

    def handle_data(self, text):
        self.words += text.split()


def assert_filters(fragment):
    """That an address of the claims names columns and values that there are."""
    values = {"paper": claims.papers(), "verdict": claims.VERDICTS, "evidence": claims.EVIDENCE}
    for column, value in parse_qsl(fragment, strict_parsing=True):
        assert value in values[column], fragment


def test_every_link_leads_somewhere():
    known = {BOOK / name: Links(BOOK / name) for name in PAGES}
    for file, page in known.items():
        for link in page.links:
            to = urlsplit(link)
            target = (file.parent / unquote(to.path)).resolve() if to.path else file
            if to.scheme in ("", "file"):
                assert target.exists(), f"{file.name}: {link}"
            if target == BOOK / "claims.html" and "=" in to.fragment:
                assert_filters(to.fragment)
            elif to.scheme == "" and to.fragment and target in known:
                assert unquote(to.fragment) in known[target].ids, f"{file.name}: {link}"


@pytest.mark.parametrize("first", ["index.html", "notebooks/00_index.html"])
def test_claims_products_and_readings_are_two_clicks_from_the_index(first):
    links = [urlsplit(link) for link in Links(BOOK / first).links]
    paths_of = {unquote(to.path) for to in links if not to.scheme and to.path.endswith(".html")}
    near = [Links(((BOOK / first).parent / path).resolve()) for path in paths_of]
    anchors = set().union(*(page.ids for page in near))
    every = {f"{paper}.{id}" for paper in claims.papers() for id in claims.read(paper)}
    assert every | {*cite.ids(), *cite.retired()} <= anchors
    shown = "\n".join(" ".join(page.words) for page in near)
    names = [" ".join(name.split()) for paper in claims.papers() for name in claims.readings(paper)]
    assert names
    assert [name for name in names if name not in shown] == []


def test_the_core_names_the_chapters_that_use_a_shared_function():
    text = " ".join(Links(BOOK / "core.html").words)
    assert re.search(r"systematic 02, 03(, 06)?\b", text)


def test_no_two_pages_have_one_title():
    titles = [re.search("<title>(.*?)</title>", (BOOK / name).read_text())[1] for name in PAGES]
    assert len(set(titles)) == len(titles)
    assert {"index.html", "README.html", "notebooks/00_index.html"} <= {*PAGES}


# What a reader does ----------------------------------------------------------------------------


def test_the_first_screen_says_what_it_is(open_page):
    page = open_page("index.html")
    for words in ("article h1", ".first img", ".first a", TOTAL):
        box = page.locator(words).first.bounding_box()
        assert box["y"] + box["height"] <= 800, words
    total = page.locator(f"{TOTAL} td").all_inner_texts()
    row = claims.scorecard(paths.products()).iloc[-1]
    counts = [row[f"measured: {verdict}"] for verdict in claims.JUDGED]
    assert total == ["all", *map(str, [sum(counts), *counts])]


def test_search_finds_a_word_and_lands_on_it(open_page):
    page = open_page("index.html")
    page.keyboard.press("Control+k")
    page.keyboard.type("Swerling")
    page.keyboard.press("Enter")
    page.locator("#search-results li a").first.click()
    page.wait_for_url(lambda url: "/search.html" not in url)
    expect(page.locator("article .highlighted").first).to_be_in_viewport()


@pytest.mark.parametrize("name", CHAPTERS)
def test_folds_open_by_keyboard_have_names_and_no_two_follow_each_other(open_page, name):
    page = open_page(name)
    names = page.locator("details.hide > summary").all_inner_texts()
    assert all(re.search(r"Code of .+, \d+ lines?$", said.strip()) for said in names)
    bare = "div.cell:has(> details.hide):not(:has(.cell_output)) + div.cell:has(> details.hide)"
    assert page.locator(bare).count() == 0
    fold = page.locator("details.hide").first
    expect(fold.locator("pre")).not_to_be_visible()
    fold.locator("summary").focus()
    page.keyboard.press("Enter")
    expect(fold.locator("pre")).to_be_visible()


def test_neighbouring_folded_cells_become_one():
    def made(source, tags=(), outputs=()):
        metadata = {"tags": list(tags)}
        return {"cell_type": "code", "source": source, "metadata": metadata, "outputs": [*outputs]}

    fold, shown = ["hide-input"], [{"data": {}}]
    cells = [
        made("a = 1", fold),
        made("def b():\n    pass\n", fold),
        made('portfolio.save(fig, "fig1")', fold, shown),
        made("c", fold),
        made("d"),
        made("e", fold),
    ]
    together = [[i for i, _ in run] for run in book.runs(cells)]
    assert together == [[0, 1, 2], [3], [4], [5]]
    one = book.folded(cells[:3])
    assert one["source"].startswith("a = 1\n\ndef b():")
    assert one["metadata"]["mystnb"]["code_prompt_show"] == "Code of fig1, b(), 4 lines"
    assert one["outputs"] == shown
    alone = book.folded([made("c", fold)])["metadata"]["mystnb"]
    assert alone["code_prompt_hide"] == "Code of this step, 1 line"


def test_the_address_of_the_claims_chooses_and_keeps_what_is_chosen(open_page):
    counts = claims.scorecard(paths.products()).set_index("paper")
    page = open_page("claims.html#paper=mda_tbd&verdict=differs&evidence=measured")
    rows = page.locator("table.claims tbody tr")
    expect(rows).to_have_count(int(counts.loc["mda_tbd", "measured: differs"]))
    chosen = page.locator("div.dtsp-searchPane tr.selected .dtsp-name")
    assert chosen.all_inner_texts() == ["mda_tbd", "differs", "measured"]
    page.locator("div.dtsp-searchPane td", has=page.get_by_text("differs", exact=True)).click()
    page.wait_for_url("**/claims.html#paper=mda_tbd&evidence=measured")
    page.locator("button.dtsp-clearAll").click()
    page.wait_for_url("**/claims.html")
    expect(rows).to_have_count(int(counts.loc["all", "claims"]))


def test_a_count_of_the_first_page_leads_to_its_claims(open_page):
    page = open_page("index.html")
    count = page.locator("article tbody tr").first.locator("td a").nth(1)
    number = int(count.inner_text())
    count.click()
    page.wait_for_url("**/claims.html#*")
    expect(page.locator("table.claims tbody tr")).to_have_count(number)


def test_what_a_narrow_screen_cannot_show_scrolls_inside_itself(open_page):
    page = open_page("index.html", 390)
    picture = page.locator(".first img").bounding_box()
    assert picture["width"] >= 600, "letters of the picture are legible"
    box = page.locator(".first .seen, .first .seen p:has(img)").last
    assert box.evaluate("box => box.scrollWidth > box.clientWidth && box.tabIndex === 0")


def test_captions_of_the_gallery_are_set_like_text(open_page):
    page = open_page("gallery.html")
    style = "box => [getComputedStyle(box).color, getComputedStyle(box).fontWeight]"
    caption = page.locator(".thumbs figcaption p").first.evaluate(style)
    assert caption == page.locator("article > section > p").first.evaluate(style)


def test_the_book_says_what_it_was_made_from(monkeypatch):
    known = clone.Clone("https://example.org/a/b", "0123456789ab")
    monkeypatch.setattr(clone, "find", lambda: known)
    said = book.origin()
    assert "commit 0123456789ab of [https://example.org/a/b](https://example.org/a/b)." in said
    monkeypatch.setattr(clone, "find", clone.Clone)
    assert re.fullmatch(r"Version [\d.]+\.", book.origin())


def test_the_filters_of_the_claims_count_as_the_scorecard(open_page):
    page, counts = open_page("claims.html"), claims.scorecard(paths.products()).set_index("paper")

    def choose(word):
        page.locator("div.dtsp-searchPane td", has=page.get_by_text(word, exact=True)).click()

    def rows(paper, column):
        shown = page.locator("table.claims tbody tr")
        expect(shown).to_have_count(int(counts.loc[paper, column]))

    page.wait_for_selector("div.dtsp-searchPane td")
    rows("all", "claims")
    choose("measured")
    for verdict in (v for v in claims.JUDGED if counts.loc["all", f"measured: {v}"]):
        choose(verdict)
        rows("all", f"measured: {verdict}")
        choose(verdict)
    choose("differs")
    choose("mda_tbd")
    rows("mda_tbd", "measured: differs")


def test_a_claim_is_found_by_its_text_and_leads_to_its_cell(open_page):
    page = open_page("claims.html")
    page.locator("div.dt-search input").fill("f7.exist12.mc exists at frame 12")
    expect(page.locator("table.claims tbody tr")).to_have_count(1)
    page.locator("table.claims tbody tr a").first.click()
    page.wait_for_url("**/04_track_cfar.html#*")
    anchor = page.locator(f'[id="{urlsplit(page.url).fragment}"]')
    code = anchor.locator("xpath=following::div[contains(@class, 'cell_input')][1]")
    assert "f7.exist12.mc" in code.text_content()


def test_a_link_to_a_claim_lands_on_its_row(open_page):
    page = open_page("claims.html#track_cfar.f7.exist12.mc")
    page.wait_for_selector("div.dtsp-searchPane td")
    expect(page.locator('[id="track_cfar.f7.exist12.mc"]')).to_be_in_viewport()


def test_the_lock_pins_with_hashes_what_the_environment_lacks():
    pins = re.compile(r"^([\w.-]+)==\S+ (?:;.*)?\\\n +--hash=sha256:", re.MULTILINE)
    own, known = (file.read_text(encoding="utf-8") for file in (LOCK, paths.lock()))
    assert len(pins.findall(own)) == len(re.findall(r"^\w", own, re.MULTILINE)) > 20
    assert not set(pins.findall(own)) & set(pins.findall(known))


# Pages made of verdicts and products -----------------------------------------------------------


def test_a_row_that_depends_shows_its_readings():
    every = scorecard.with_seeds(claims.ledger(paths.products()))
    every = every.assign(verdict="depends", readings="1 of 2: m reproduced, m-r differs")
    row = next(every.itertuples())
    cells = book.claim_row(book.Chapter(row.paper), row, [])
    assert cells["verdict"] == "depends"
    assert "<b>readings</b> 1 of 2: m reproduced, m-r differs" in cells["claim"]


def test_a_retired_figure_has_a_place_in_the_book(monkeypatch):
    old = cite.Retired("dp_tbd/fig99", "0123abc", "dp_tbd/fig02")
    monkeypatch.setattr(cite, "retired", lambda: {old.id: old})
    chapters = {paper: book.Chapter(paper) for paper in pages.notebooks()}
    page = book.figures_page(cite.listing(), chapters)
    assert f'- <span id="{old.id}"></span>{old}.\n' in page


# Bad input -------------------------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path):
    """A copy of the repository with an old book."""
    for name in ("benchmarks", "data", "docs", "figures", "notebooks", "tests"):
        shutil.copytree(paths.root() / name, tmp_path / name)
    for name in (*book.FILES, "pyproject.toml"):
        shutil.copy(paths.root() / name, tmp_path / name)
    (tmp_path / "build" / "book").mkdir(parents=True)
    (tmp_path / "build" / "book" / "index.html").write_text("old")
    return tmp_path


def spoil(file, old, new):
    text = file.read_text(encoding="utf-8")
    assert re.search(old, text)
    file.write_text(re.sub(old, new, text, count=1), encoding="utf-8")


WRONG = {
    "not executed": lambda folder: spoil(
        folder / "notebooks" / "01_dp_tbd.ipynb",
        r'"execution_count": 7\b',
        '"execution_count": null',
    ),
    "05_ljipda_ai.ipynb: no notebook": lambda folder: (
        folder / "notebooks" / "05_ljipda_ai.ipynb"
    ).write_text("{}"),
    "not what the verdicts say": lambda folder: spoil(
        folder / "figures" / "scorecard.md", r"\| 40 \|", "| 41 |"
    ),
    "retired.csv, row 2, column last_commit": lambda folder: (
        folder / "figures" / "retired.csv"
    ).write_text("id,last_commit,instead\ndp_tbd/fig99,HEAD,\n"),
    "fig02.png is missing": lambda folder: (folder / "figures/dp_tbd/fig02.png").unlink(),
    "no_such_page": lambda folder: spoil(
        folder / "docs" / "running.md", "# Running", "# Running\n\n[nowhere](no_such_page.md)"
    ),
}


@pytest.mark.parametrize("says", WRONG)
def test_a_book_that_cannot_be_built_leaves_the_old_one(copy, says):
    WRONG[says](copy)
    words = {"TBDCORE_REPOSITORY": str(copy), "PYTHONPATH": str(paths.root())}
    command = [sys.executable, str(copy / "docs" / "book.py")]
    run = subprocess.run(command, env=os.environ | words, capture_output=True, text=True)
    assert run.returncode == 1
    assert says in run.stderr
    assert run.stderr.count("\n") == 1
    assert (copy / "build" / "book" / "index.html").read_text() == "old"
    left = {path.name for path in (copy / "build").iterdir()}
    assert left <= {"book", "book.log"}
