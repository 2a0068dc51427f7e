"""Guards over the committed notebooks: what nbval would not notice, and what a page must have."""

import ast
import inspect
import json
import math
import re

import pytest
from numba.core.registry import CPUDispatcher

from tbdcore.repro import claims, pages, paths, products

NOTEBOOKS = {path.stem: path for path in sorted(paths.notebooks().glob("*.ipynb"))}
PAPERS = pages.papers()
COMMON = {"seed": "int", "n_trials": "int", "workers": "int", "scheduler": "str", "out": "str"}
NO_PATH = re.compile(
    r"""["'](?:\.{0,2}/|~/|[A-Za-z]:\\)[\w./\\-]*["']|\bopen\(|\bPath\(|\.(?:to|read)_csv\("""
)
MACHINE = re.compile(
    r"/(?:root|home|Users)/\w|/tm"
    + r"p/|/wo"
    + r"rk/|/opt/\w|\.venv|site-packages|ipykernel_\d|0x[0-9a-f]{8,}"
)


def cells(name, kind="code"):
    """Cells of a notebook, of one kind."""
    notebook = json.loads(NOTEBOOKS[name].read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == kind]


def source(cell):
    return "".join(cell["source"])


def outputs(name):
    """Every output of a notebook, with the number of its cell."""
    return [(cell["execution_count"], output) for cell in cells(name) for output in cell["outputs"]]


def texts(name):
    """What a notebook shows as text: streams and the textual renderings of results."""
    for count, output in outputs(name):
        shown = [
            output.get("text", ""),
            *(text for kind, text in output.get("data", {}).items() if kind.startswith("text/")),
        ]
        for text in shown:
            yield count, "".join(text)


def code_lines(name):
    """Lines of code that a notebook runs, without strings and comments that span lines."""
    return [
        (number, line)
        for number, cell in enumerate(cells(name), start=1)
        for line in source(cell).splitlines()
    ]


@pytest.mark.parametrize("paper", pages.notebooks())
def test_the_products_were_made_from_the_present_sources(paper):
    records = (paths.products() / paper).glob("*.json")
    made = {json.loads(record.read_text(encoding="utf-8"))["digest"] for record in records}
    again = f"tbdcore run {paper} --in-place"
    assert made == {pages.digest(paper)}, f"the sources have changed since: {again}"


every_notebook = pytest.mark.parametrize("name", NOTEBOOKS)
every_paper = pytest.mark.parametrize("paper", PAPERS)
every_page = pytest.mark.parametrize("paper", [*PAPERS, "together"])  # all but the index


def test_each_paper_has_claims_a_notebook_and_a_bibliography():
    assert sorted(PAPERS) == claims.papers()
    text = paths.bibliography().read_text(encoding="utf-8")
    assert all(f"[{paper}]" in text for paper in PAPERS)


@every_notebook
def test_every_code_cell_was_executed_in_order(name):
    """nbval compares nothing in a cell without a count."""
    assert [cell["execution_count"] for cell in cells(name)] == list(range(1, len(cells(name)) + 1))


@every_notebook
def test_nothing_failed_and_nothing_warned(name):
    for count, output in outputs(name):
        assert output["output_type"] != "error", f"cell {count}"
        assert output.get("name") != "stderr", f"cell {count}: {output['text']}"


@every_notebook
def test_nothing_is_skipped(name):
    for number, cell in enumerate(cells(name), start=1):
        tags = cell["metadata"].get("tags", [])
        assert set(tags) <= {"algorithm", "parameters", "hide-input"}, (
            f"cell {number}: nbval obeys tags such as nbval-skip"
        )
        assert not re.search(r"(?i)#\s*(?:nbval|pytest)", source(cell)), f"cell {number}"


@every_notebook
def test_no_cell_is_empty_or_long(name):
    for number, cell in enumerate(cells(name), start=1):
        lines = [line for line in source(cell).splitlines() if line.strip()]
        most = 50 if "@kernel" in lines else 30  # a compiled loop stays in one cell
        assert 1 <= len(lines) <= most, f"cell {number}: {len(lines)} lines"
    assert all(source(cell).strip() for cell in cells(name, "markdown"))


@every_notebook
def test_the_code_is_free_of_what_does_not_belong_on_a_page(name):
    for number, line in code_lines(name):
        assert not line.rstrip().endswith(";"), f"cell {number}: {line}"
        assert not re.match(r"\s*[!%]", line), f"cell {number}: {line}"  # pip, cd, magics
        assert "filterwarnings" not in line, f"cell {number}: {line}"
        assert not NO_PATH.search(line), f"cell {number}: a path: {line}"
        assert not re.search(r"\bmatplotlib\b|default_rng\((?:\)|\d)|random\.seed", line), (
            f"cell {number}: {line}"
        )


@every_notebook
def test_no_picture_comes_from_elsewhere(name):
    for cell in cells(name, "markdown"):
        assert not re.search(r"!\[[^\]]*\]\(|<img|<iframe|<script", source(cell)), source(cell)[:80]


@every_notebook
def test_no_output_knows_the_machine(name):
    for count, text in texts(name):
        assert not MACHINE.search(text), f"cell {count}: {MACHINE.search(text)[0]}"


@every_notebook
def test_metadata_is_clean(name):
    notebook = json.loads(NOTEBOOKS[name].read_text(encoding="utf-8"))
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}
    for cell in notebook["cells"]:
        assert set(cell["metadata"]) <= {"tags", "jupyter", "mystnb"}
        folded = "hide-input" in cell["metadata"].get("tags", [])
        assert cell["metadata"].get("jupyter") == ({"source_hidden": True} if folded else None)


@every_notebook
def test_every_picture_has_a_visible_caption_and_alternative_text(name):
    for cell in cells(name):
        shown = [output for output in cell["outputs"] if "image/png" in output.get("data", {})]
        for output in shown:
            alt = output["metadata"]["image/png"]["alt"]
            assert cell["metadata"]["mystnb"]["image"]["alt"] == alt
            captions = [
                "".join(o.get("data", {}).get("text/markdown", "")) for o in cell["outputs"]
            ]
            assert any(caption.endswith(alt) for caption in captions), alt


@every_page
def test_parameters_are_complete_and_nothing_runs_before_them(paper):
    """Before them: imports, and the first screen, which shows committed products."""
    name = pages.path(paper).stem
    tagged = [i for i, c in enumerate(cells(name)) if "parameters" in c["metadata"].get("tags", [])]
    assert len(tagged) == 1
    for cell in cells(name)[: tagged[0]]:
        for node in ast.parse(source(cell)).body:
            shows = isinstance(node, ast.Expr) and ast.unparse(node).startswith("screen.")
            text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            assert isinstance(node, ast.Import | ast.ImportFrom) or shows or text
    known = pages.parameters(paper)
    common = {parameter.name: parameter.type for parameter in list(known.values())[:5]}
    assert common == COMMON


@pytest.mark.parametrize("paper", pages.notebooks())
def test_every_parameter_says_what_it_may_be(paper):
    for parameter in pages.parameters(paper).values():
        assert parameter.meaning, parameter.name
        if parameter.type in ("int", "float", "list"):
            assert parameter.low > -math.inf or parameter.high < math.inf, (
                f"{parameter.name} has no range"
            )
        elif parameter.type == "str" and parameter.name not in pages.EXECUTION:
            assert parameter.choices, f"{parameter.name} has no choices"
        assert parameter.coerce(parameter.default) == parameter.default
        if parameter.quick is not None:
            parameter.coerce(parameter.quick)


@every_page
def test_quick_means_few_trials(paper):
    trials = pages.parameters(paper)["n_trials"]
    assert trials.quick is not None
    assert trials.quick < trials.default


@every_page
def test_a_notebook_begins_and_publishes(paper):
    name = pages.path(paper).stem
    text = [source(cell) for cell in cells(name)]
    begins = [i for i, cell in enumerate(text) if "tbdcore.begin(" in cell]
    assert len(begins) == 1
    assert f'tbdcore.begin("{paper}", vars())' in text[begins[0]]
    ledger = "ledger" if paper in PAPERS else ""
    assert text[-1].strip().endswith(f"portfolio.publish({ledger})")
    assert sum("portfolio.publish(" in cell for cell in text) == 1


@every_paper
def test_every_claim_of_the_paper_has_its_verdict(paper):
    table, rows = claims.verdicts(paper), claims.read(paper)
    assert set(table["verdict"]) <= set(claims.VERDICTS)
    for row in table.itertuples():
        claim = rows[row.id]
        judged = row.verdict in claims.JUDGED
        assert judged == bool(claim.rule) == bool(row.evidence), row.id
        assert row.verdict != "used" or claim.kind == "input", row.id
        assert bool(row.cause) == (row.verdict in ("differs", "untestable")), row.id


@every_paper
def test_a_cause_names_a_section_that_exists_or_says_not_excluded(paper):
    headings = [
        line.lstrip("# ")
        for cell in cells(pages.path(paper).stem, "markdown")
        for line in source(cell).splitlines()
        if line.startswith("#")
    ]
    numbers = {heading.split(" ")[0].rstrip(".") for heading in headings}
    for claim in claims.read(paper).values():
        named = re.findall(
            r"(?:[Ss]ections?|Appendix|Appendices) ([A-G](?:\.\d+)?|\d(?:\.\d+)?)", claim.cause
        )
        if claim.cause:
            assert named or "not excluded" in claim.cause, f"{claim.id}: {claim.cause}"
        assert set(named) <= numbers, f"{claim.id}: {claim.cause}"


@every_paper
def test_the_algorithm_stands_alone(paper):
    """The page's module needs neither the parameters cell nor an experiment."""
    page = pages.page(paper)
    assert list(inspect.signature(page.run).parameters)[1] == "p", "run(data, parameters, ...)"
    for name in COMMON:
        assert not hasattr(page, name), f"an algorithm cell uses the parameter {name}"


@every_paper
def test_no_page_takes_a_kernel_of_the_core_by_name(paper):
    """A trial carries such a kernel to each process, which compiles it again in every run."""
    names = vars(pages.page(paper)).items()
    compiled = {name: value for name, value in names if isinstance(value, CPUDispatcher)}
    assert [name for name, f in compiled.items() if f.__module__.startswith("tbdcore.")] == []


@every_notebook
def test_every_figure_is_the_last_expression_of_its_cell(name):
    for number, cell in enumerate(cells(name), start=1):
        text = source(cell)
        calls = text.count("portfolio.save(")
        assert calls <= 1, f"cell {number} saves {calls} figures; one figure per cell"
        if calls:
            assert any("image/png" in output.get("data", {}) for output in cell["outputs"]), (
                f"cell {number} does not show its figure"
            )


# The shape of a chapter ------------------------------------------------------------------------

MAIN = ("1", "2", "3", "4", "5", "6", "7")
APPENDICES = "ABCDEFG"
SECTIONS = {
    "1": "Problem",
    "2": "Data",
    "3": "Derivation",
    "4": "Algorithm",
    "5": "Experiments",
    "6": "Meaning",
    "7": "Your own data",
    "A": "Inputs and letters",
    "B": "One frame by hand",
    "C": "Checks",
    "D": "Readings",
    "E": "Every claim",
    "F": "Beyond the paper",
    "G": "Not done",
}


def all_cells(paper):
    return json.loads(pages.path(paper).read_text(encoding="utf-8"))["cells"]


def heading(cell):
    """Number or letter and title of a section that begins in a cell, or None."""
    if cell["cell_type"] != "markdown":
        return None
    found = re.match(r"##? (?:Appendix )?([1-7A-G])\.? (.+)", source(cell))
    return found and (found[1], found[2].strip())


@every_paper
def test_a_chapter_has_the_sections_of_all_chapters(paper):
    found = [title for cell in all_cells(paper) if (title := heading(cell))]
    assert all(SECTIONS[number] == title for number, title in found), found
    numbers = [number for number, _ in found]
    assert numbers == sorted(numbers)
    assert set(numbers) >= {*MAIN, "A", "C", "E"}


@every_notebook
def test_a_notebook_is_no_burden_for_a_browser(name):
    assert NOTEBOOKS[name].stat().st_size < 1_700_000


def test_the_page_on_common_scenes_begins_with_its_result():
    page = all_cells("together")
    shown = "\n".join(source(cell) for cell in page[:5])
    assert 'screen.exhibit("together/' in shown
    assert shown.index("screen.exhibit(") < 1_500, "the result comes first"
    headings = [source(cell).split("\n")[0] for cell in page if cell["cell_type"] == "markdown"]
    numbers = [title[3] for title in headings if title.startswith("## ")]
    assert numbers == sorted(numbers)


@every_paper
def test_the_first_screen_shows_the_outcome(paper):
    """Before the parameters: the table of verdicts and one figure, as committed."""
    code = cells(pages.path(paper).stem)
    first = [i for i, c in enumerate(code) if "parameters" in c["metadata"].get("tags", [])][0]
    shown = "\n".join(source(cell) for cell in code[:first])
    assert f'screen.outcome("{paper}"' in " ".join(shown.split()).replace("( ", "(")
    assert "screen.exhibit(" in shown
    for cell in code[:first]:
        for output in cell["outputs"]:
            text = "".join(output.get("data", {}).get("text/markdown", ""))
            assert "not yet run" not in text
            most = 8 if text.startswith("| method |") else 6
            assert text.count("\n|") <= 1 + most, f"at most {most} rows"


def flown(rule, trials):
    """How many trials a rule asks for, on a page that flies `trials`."""
    known = claims.numbers(rule)
    return int(known["flights"] if "flights" in known else known.get("share", 1) * trials + 1e-9)


@every_paper
def test_each_row_has_the_trials_that_its_rule_names(paper):
    verdicts = claims.verdicts(paper, paths.products()).set_index("id")["n"]
    record = next((paths.products() / paper).glob("*.json"))
    trials = products.record(record)["trials"]
    asked = {id: flown(row.rule, trials) for id, row in claims.read(paper).items() if row.evidence}
    got = {id: int(verdicts[id]) for id in asked if verdicts[id]}
    wrong = {id: (n, asked[id]) for id, n in got.items() if n != asked[id]}
    if paper == "track_cfar":  # the flights of this one that are alive when the target vanishes
        n, most = wrong.pop("f7.fast.ending")
        assert 0.99 * most < n < most
    assert wrong == {}
    assert len(got) >= 20


@every_notebook
def test_no_printed_line_is_wider_than_the_book(name):
    for count, text in texts(name):
        plain = [line for line in text.splitlines() if not line.lstrip().startswith(("|", "<"))]
        if "<table" not in text and not text.startswith(("|", "*")):
            assert all(len(line) <= 100 for line in plain if "  " in line), f"cell {count}"


@every_notebook
def test_a_display_has_one_tag_and_none_with_line_breaks(name):
    for cell in cells(name, "markdown"):
        for formula in re.findall(r"\$\$(.*?)\$\$", source(cell), re.DOTALL):
            tags = formula.count(r"\tag")
            assert tags <= 1, formula
            assert not (tags and r"\\" in formula), formula
