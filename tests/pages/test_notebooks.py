"""Guards over the committed notebooks: what nbval would not notice, and what a page must have."""

import ast
import inspect
import json
import math
import re

import pytest

from tbdcore.repro import claims, pages, paths

NOTEBOOKS = {path.stem: path for path in sorted(paths.NOTEBOOKS.glob("*.ipynb"))}
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


every_notebook = pytest.mark.parametrize("name", NOTEBOOKS)
every_paper = pytest.mark.parametrize("paper", PAPERS)


def test_each_paper_has_claims_a_notebook_and_a_bibliography():
    assert sorted(PAPERS) == claims.papers()
    text = paths.BIBLIOGRAPHY.read_text(encoding="utf-8")
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
        assert set(tags) <= {"algorithm", "parameters"}, (
            f"cell {number}: nbval obeys tags such as nbval-skip"
        )
        assert not re.search(r"(?i)#\s*(?:nbval|pytest)", source(cell)), f"cell {number}"


@every_notebook
def test_no_cell_is_empty_or_long(name):
    for number, cell in enumerate(cells(name), start=1):
        lines = [line for line in source(cell).splitlines() if line.strip()]
        assert 1 <= len(lines) <= 30, f"cell {number}: {len(lines)} lines"
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


def is_code(comment):
    """Whether the text of a comment is a statement that does something."""
    try:
        tree = ast.parse(comment).body
    except SyntaxError:
        return False
    return any(
        isinstance(node, ast.Assign | ast.Import | ast.ImportFrom | ast.For | ast.If | ast.Return)
        for node in tree
    ) or any(isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) for node in tree)


@every_notebook
def test_no_code_is_commented_out(name):
    for number, line in code_lines(name):
        if line.lstrip().startswith("#"):
            assert not is_code(line.lstrip("# ").rstrip()), f"cell {number}: {line}"


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
    assert all(set(cell["metadata"]) <= {"tags"} for cell in notebook["cells"])


@every_paper
def test_parameters_come_first_and_are_complete(paper):
    name = pages.path(paper).stem
    tagged = [
        i for i, cell in enumerate(cells(name)) if "parameters" in cell["metadata"].get("tags", [])
    ]
    assert len(tagged) == 1
    for cell in cells(name)[: tagged[0]]:  # imports only
        assert all(
            isinstance(node, ast.Import | ast.ImportFrom) for node in ast.parse(source(cell)).body
        )
    known = pages.parameters(paper)
    assert {parameter.name: parameter.type for parameter in list(known.values())[:5]} == COMMON


@every_paper
def test_every_parameter_says_what_it_may_be(paper):
    for parameter in pages.parameters(paper).values():
        assert parameter.meaning, parameter.name
        if parameter.type in ("int", "float", "list"):
            assert parameter.low > -math.inf or parameter.high < math.inf, (
                f"{parameter.name} has no range"
            )
        elif parameter.type == "str" and parameter.name not in pages.PLUMBING:
            assert parameter.choices, f"{parameter.name} has no choices"
        assert parameter.coerce(parameter.default) == parameter.default
        if parameter.quick is not None:
            parameter.coerce(parameter.quick)


@every_paper
def test_quick_means_few_trials(paper):
    trials = pages.parameters(paper)["n_trials"]
    assert trials.quick is not None
    assert trials.quick < trials.default


@every_paper
def test_a_notebook_begins_and_publishes(paper):
    name = pages.path(paper).stem
    text = [source(cell) for cell in cells(name)]
    begins = [i for i, cell in enumerate(text) if "tbdcore.begin(" in cell]
    assert len(begins) == 1
    assert f'tbdcore.begin("{paper}", vars())' in text[begins[0]]
    assert text[-1].strip().endswith("portfolio.publish(ledger)")
    assert sum("portfolio.publish(" in cell for cell in text) == 1


@every_paper
def test_every_claim_of_the_paper_has_its_verdict(paper):
    """In the committed verdicts; only the chapter whose text says why may leave a claim
    `inconclusive`.
    """
    table = claims.verdicts(paper)
    rows = claims.read(paper)
    assert set(table["verdict"]) <= set(claims.VERDICTS)
    assert paper == "mda_tbd" or "inconclusive" not in set(table["verdict"])
    for row in table.itertuples():
        is_input = rows[row.id].kind == "input"
        assert row.verdict != "used" or is_input, row.id
        assert row.verdict in ("used", "untestable") or not is_input, row.id
        assert bool(row.cause) == (row.verdict in ("differs", "untestable", "inconclusive")), row.id


@every_paper
def test_the_algorithm_stands_alone(paper):
    """The page's module needs neither the parameters cell nor an experiment."""
    page = pages.page(paper)
    assert list(inspect.signature(page.run).parameters)[1] == "p", "run(data, parameters, ...)"
    for name in COMMON:
        assert not hasattr(page, name), f"an algorithm cell uses the parameter {name}"


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
