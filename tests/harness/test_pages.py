"""Pages: what a parameters cell says is what is checked, and a page is a module like any other."""

import copy
import json
import os
import shutil
import subprocess
import sys
import types
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nbformat
import numpy as np
import pytest
import tiny

from tbdcore.repro import pages, paths, publish, trials

CELL = """seed: int = 20  # root of every random stream; in [0, inf)
n_trials: int = 400  # Monte Carlo trials; in [1, inf); quick 40
workers: int = 0  # processes, 0 for one per core; in [0, inf)
scheduler: str = ""  # address of a dask scheduler, empty for this machine
out: str = ""  # folder for products, empty for the repository's figures/
track_pfa: float = 0.1  # track false-alarm probability P_F; in (0, 1)
blur: float = (
    0.6  # width in cells, a line that was wrapped; in (0, 0.8]
)
reading: str = "m"  # how eq. (10) is read; one of "m", "m-r"
snr_db: list = [3, 4.5]  # grid, dB; in [-30, 40]
square_law: bool = False  # accumulate z**2
rates: list = [0, 0.2]  # turn rates, rad/s; in [-1, 1]; increasing"""


@pytest.fixture
def paper(repository):
    """A paper whose notebook has the parameters above."""
    rewrite(repository, parameters=CELL)
    return "tiny"


def rewrite(repository, **cells):
    (repository / "notebooks" / "01_tiny.ipynb").write_text(
        tiny.notebook(tiny.CELLS | cells), encoding="utf-8"
    )


def values(paper, **changed):
    """A notebook's namespace after its parameters cell."""
    return {
        name: parameter.default for name, parameter in pages.parameters(paper).items()
    } | changed


def one_line(caught, *words):
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


def test_parameters_are_read_from_the_cell(paper):
    known = pages.parameters(paper)
    assert list(known)[:5] == ["seed", "n_trials", *pages.EXECUTION]
    assert known["track_pfa"] == pages.Parameter(
        "track_pfa", "float", 0.1, "track false-alarm probability P_F", 0.0, 1.0, "()"
    )
    assert known["blur"].range() == "(0, 0.8]"
    assert known["n_trials"].quick == 40
    assert known["reading"].choices == ("m", "m-r")
    assert known["snr_db"].default == [3, 4.5]


GOOD = [
    ("n_trials", 1e3, 1000),
    ("track_pfa", 0.5, 0.5),
    ("snr_db", [40, -30], [40, -30]),
    ("reading", "m-r", "m-r"),
    ("blur", 0.8, 0.8),
    ("rates", [0.4], [0.4]),
]


@pytest.mark.parametrize(
    ("name", "value", "coerced"), [*GOOD, ("square_law", True, True), ("seed", 0, 0)]
)
def test_good_values_take_the_parameters_type(paper, name, value, coerced):
    ours = pages.validate(paper, {name: value})[name]
    assert ours == coerced
    assert type(ours) is type(coerced)


def test_an_integer_for_a_float(repository):
    rewrite(repository, parameters="gate_g: float = 4.0  # gate; in (0, inf)")
    assert repr(pages.validate("tiny", {"gate_g": 3})["gate_g"]) == "3.0"


BAD = {  # values by the name of the parameter
    "n_trials": [0, 1.5, True, "many"],
    "track_pfa": [0.0, 1, float("nan")],
    "blur": [0.8001],
    "reading": ["n"],
    "snr_db": [[3, 41], ["3"], 3],
    "square_law": [1],
    "rates": [[0.2, 0], [0.2, 0.2], []],
    "track_pfb": [0.1],  # there is none of this name
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in BAD.items() for value in values]
)
def test_bad_values_are_refused_in_a_line(paper, name, value):
    with pytest.raises(ValueError, match=rf"^parameter '?{name}'?: ") as caught:
        pages.validate(paper, {name: value})
    one_line(caught, "track_pfa" if name == "track_pfb" else repr(value))


def test_an_unknown_paper_is_told_the_nearest(paper):
    with pytest.raises(ValueError, match="the nearest is 'tiny'") as caught:
        pages.parameters("tinny")
    one_line(caught)


@pytest.mark.parametrize("line", ["seed = 3", "seed: complex = 3", "print(1)"])
def test_a_line_that_is_no_parameter_is_named(repository, line):
    rewrite(repository, parameters=f"n_trials: int = 3  # trials; in [1, inf)\n{line}")
    with pytest.raises(ValueError, match="parameters cell, line 2"):
        pages.parameters("tiny")


def test_begin_opens_a_default_run(paper, repository):
    ledger, portfolio = publish.begin(paper, values(paper))
    assert ledger.strict
    assert portfolio.folder == repository / "figures"
    assert portfolio.provenance["seed"] == 20
    assert set(portfolio.provenance["parameters"]) == set(pages.parameters(paper)) - set(
        pages.EXECUTION
    )


def test_begin_puts_coerced_values_back(paper):
    namespace = values(paper, n_trials=400.0)
    publish.begin(paper, namespace)
    assert repr(namespace["n_trials"]) == "400"


def test_begin_finds_a_misspelt_parameter(paper):
    """Papermill injects what it is given, and runs the rest with the default."""
    with pytest.raises(ValueError, match=r"'n_trails'.*the nearest is 'n_trials'") as caught:
        publish.begin(paper, values(paper, n_trails=5))
    one_line(caught)


def test_begin_does_not_mind_what_a_notebook_has(paper):
    others = {
        "np": np,
        "page": types.SimpleNamespace(),
        "In": [""],
        "Out": {},
        "_i1": "",
        "__name__": "__main__",
        "run": len,
    }
    publish.begin(paper, values(paper, **others))


def test_begin_refuses_other_parameters_in_the_committed_figures(paper):
    with pytest.raises(ValueError, match="figures are for default parameters") as caught:
        publish.begin(paper, values(paper, n_trials=7))
    one_line(caught, "give another: build/try")


def test_parameters_that_change_no_result_may_differ(paper):
    assert publish.begin(paper, values(paper, workers=3))[0].strict


def test_begin_with_other_parameters_and_a_folder(paper, tmp_path):
    ledger, portfolio = publish.begin(paper, values(paper, n_trials=7, out=str(tmp_path / "try")))
    assert not ledger.strict
    assert portfolio.folder == tmp_path / "try"
    assert list(portfolio.folder.iterdir()) == []  # the probe is gone


def test_a_relative_folder_is_made_with_its_parents(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert pages.usable("a/b") == tmp_path / "a" / "b"
    assert (tmp_path / "a" / "b").is_dir()


def test_an_absolute_folder_needs_its_parent(tmp_path):
    with pytest.raises(ValueError, match="No such file or directory; give a folder") as caught:
        pages.usable(str(tmp_path / "a" / "b"))
    one_line(caught, str(tmp_path))
    assert not (tmp_path / "a").exists()


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="give a folder that can be written"):
        pages.usable(str(tmp_path / "file"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ValueError, match="Permission denied; give a folder"):
        pages.usable(str(tmp_path / "new"))


ALGORITHM = """import numpy as np

from tbdcore import kernel
from tbdcore.repro import trials


@kernel
def total(z):
    s = 0.0
    for value in z:
        s += value
    return s


def run(seed, i):
    return total(trials.generator(seed, "tiny", "page", i, "noise").random(4))"""


def test_a_page_is_a_module(repository):
    rewrite(repository, algorithm=ALGORITHM)
    page = pages.page("tiny")
    assert isinstance(page, types.ModuleType)
    assert pages.page("tiny") is page
    assert page.total(np.array([1.0, 2.0])) == 3.0
    assert not hasattr(page, "n_trials"), "cells of other tags are not part of it"
    assert Path(page.__file__).read_text(encoding="utf-8") == ALGORITHM


def test_a_page_follows_its_notebook(repository):
    rewrite(repository, algorithm="answer = 1")
    assert pages.page("tiny").answer == 1
    rewrite(repository, algorithm="answer = 2")
    assert pages.page("tiny").answer == 2


def test_a_page_with_a_kernel_works_where_nothing_can_be_written(repository, monkeypatch):
    (repository / "file").write_text("in the way of a folder")
    monkeypatch.setenv("TBDCORE_BUILD", "file/build")
    cells = {
        "algorithm": "from tbdcore import kernel\n\n\n@kernel\ndef twice(x):\n    return 2 * x",
        "parameters": "seed: int = 1",
    }
    (repository / "notebooks" / "01_tiny.ipynb").write_text(tiny.notebook(cells), encoding="utf-8")
    assert pages.page("tiny").twice(3) == 6


CALLER = """from callee import step
from tbdcore import kernel


@kernel
def twice(x):
    return step(step(x))
"""
SHELL = "from IPython.core.interactiveshell import InteractiveShell as Shell\n" + (
    f"shell = Shell.instance()\nshell.run_cell({CALLER!r})\nshell.run_cell('print(twice(1))')"
)


@pytest.mark.slow
def test_a_kernel_of_a_cell_follows_the_kernels_that_it_calls(tmp_path):
    places = {name: str(tmp_path) for name in ("PYTHONPATH", "IPYTHONDIR", "XDG_CACHE_HOME")}
    for step, printed in (("x + 1", "3"), ("x + 10", "21")):
        callee = f"from tbdcore import kernel\n\n\n@kernel\ndef step(x):\n    return {step}\n"
        (tmp_path / "callee.py").write_text(callee)
        ran = subprocess.run(
            [sys.executable, "-c", SHELL], env=os.environ | places, capture_output=True, text=True
        )
        assert ran.stdout.split()[-1:] == [printed], ran.stderr


def test_a_page_may_use_another_and_its_digest_follows_it(repository):
    cells = tiny.CELLS | {"algorithm": 'import tbdcore\n\nused = tbdcore.page("tiny")'}
    other = repository / "notebooks" / "02_other.ipynb"
    other.write_text(tiny.notebook(cells), encoding="utf-8")
    rewrite(repository, algorithm="answer = 1")
    before = pages.digest("other")
    assert pages.page("other").used is pages.page("tiny")
    rewrite(repository, algorithm="answer = 2")
    assert pages.digest("other") != before


def test_pages_without_claims_come_after_the_papers_and_the_index_last(repository):
    free = tiny.notebook(tiny.CELLS | {"publish": "portfolio.publish()"})
    for name in ("00_index", "06_together"):
        (repository / "notebooks" / f"{name}.ipynb").write_text(free, encoding="utf-8")
    assert pages.papers() == ["tiny"]
    assert pages.notebooks() == ["tiny", "together", "index"]
    assert pages.has_ledger("tiny")
    assert not pages.has_ledger("together")


def test_a_broken_page_is_not_kept(repository):
    rewrite(repository, algorithm="answer = 1 / 0")
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            pages.page("tiny")


def test_threads_that_ask_at_once_get_one_whole_page(repository):
    rewrite(repository, algorithm="import time\n\ntime.sleep(0.2)\nanswer = 3")
    with ThreadPoolExecutor(8) as pool:
        asked = list(pool.map(lambda _: pages.page("tiny"), range(8)))
    assert {page.answer for page in asked} == {3}
    assert all(page is asked[0] for page in asked)


def test_functions_of_a_page_reach_the_workers(repository):
    rewrite(repository, algorithm=ALGORITHM)
    page = pages.page("tiny")
    ours = trials.run(page.run, 5, seed=1, workers=2)
    np.testing.assert_array_equal(ours, [page.run(1, i) for i in range(5)])


def test_the_digest_follows_code_claims_rules_and_modules(repository, tmp_path, monkeypatch):
    tiny.copy_package(tmp_path)
    monkeypatch.setattr(paths, "PACKAGE", tmp_path / "tbdcore")
    seen = [pages.digest("tiny")]
    rewrite(repository, claims="1 + 1")
    seen.append(pages.digest("tiny"))
    (paths.claims() / "tiny.csv").write_text(tiny.CLAIMS.replace("cheap", "dear"))
    seen.append(pages.digest("tiny"))
    module = tmp_path / "tbdcore" / "repro" / "trials.py"
    module.write_text(module.read_text().replace("SHARES = 3", "SHARES = 4"))
    seen.append(pages.digest("tiny"))
    assert len(set(seen)) == 4
    with module.open("a") as file:
        file.write("\n\ndef unused(x):\n    return x\n")
    assert pages.digest("tiny") == seen[-1]


def test_the_digest_does_not_see_comments_docstrings_text_cells_and_causes(
    repository, tmp_path, monkeypatch
):
    tiny.copy_package(tmp_path)
    monkeypatch.setattr(paths, "PACKAGE", tmp_path / "tbdcore")
    before = pages.digest("tiny")
    rewrite(repository, trials=f"# a remark\n{tiny.CELLS['trials']}  # another")
    for module in (tmp_path / "tbdcore").rglob("*.py"):
        source = module.read_text(encoding="utf-8")
        module.write_text(
            source.replace('"""', '"""Words. ', 1) + "\n# a remark\n", encoding="utf-8"
        )
    caused = tiny.CLAIMS.replace("measured,\n", "measured,because\n")
    (paths.claims() / "tiny.csv").write_text(caused)
    assert caused != tiny.CLAIMS
    assert pages.digest("tiny") == before


def test_the_digest_of_the_index_follows_verdicts_and_methods_of_all_papers(tmp_path, monkeypatch):
    shutil.copytree(
        paths.products(), tmp_path / "figures", ignore=shutil.ignore_patterns("*.p??", "*.svg")
    )
    monkeypatch.setenv("TBDCORE_FIGURES", str(tmp_path / "figures"))
    before, chapter = pages.digest("index"), pages.digest("track_cfar")
    with (tmp_path / "figures" / "track_cfar" / "verdicts.csv").open("a") as file:
        file.write("\n")
    after = pages.digest("index")
    assert after != before
    (tmp_path / "figures" / "track_cfar" / "methods.csv").write_text("method\n")
    assert pages.digest("index") not in (before, after)
    assert pages.digest("track_cfar") == chapter


def executed():
    """What papermill leaves: an injected cell, times, counts and standard error."""
    notebook = json.loads(
        tiny.notebook({name: tiny.CELLS[name] for name in ("algorithm", "parameters")})
    )
    injected = copy.deepcopy(notebook["cells"][1])
    injected["metadata"] = {"tags": ["injected-parameters"]}
    notebook["cells"].insert(2, injected)
    for count, cell in enumerate(notebook["cells"], start=5):
        cell["execution_count"] = count
        cell["metadata"]["papermill"] = {"duration": 0.1}
        cell["outputs"] = [
            {"output_type": "stream", "name": "stderr", "text": "noise"},
            {"output_type": "execute_result", "execution_count": count, "data": {}, "metadata": {}},
        ]
    notebook["metadata"]["papermill"] = {"start_time": "now"}
    return notebook


def test_clean_leaves_what_is_committed():
    notebook = pages.clean(executed())
    assert [cell["execution_count"] for cell in notebook["cells"]] == [1, 2]
    assert [cell["metadata"] for cell in notebook["cells"]] == [
        {"tags": ["algorithm"]},
        {"tags": ["parameters"]},
    ]
    assert [[out["execution_count"] for out in cell["outputs"]] for cell in notebook["cells"]] == [
        [1],
        [2],
    ]
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}


def test_clean_changes_nothing_twice():
    once = pages.clean(executed())
    assert pages.clean(copy.deepcopy(once)) == once


def test_ruff_finds_nothing_to_order_in_a_clean_notebook(tmp_path):
    """So that a change of one line of code changes one line of the file."""
    notebook, file = executed(), tmp_path / "page.ipynb"
    first = notebook["cells"][0]
    first["metadata"]["tags"] = ["hide-input"]
    first["outputs"] = [
        {
            "output_type": "display_data",
            "data": {"image/png": "", "text/plain": "<σ>"},
            "metadata": {"image/png": {"alt": "a picture"}},
        }
    ]
    notebook["cells"][2]["id"] = "injected"
    nbformat.write(nbformat.from_dict(notebook), file)  # as papermill does
    notebook = pages.clean(json.loads(file.read_text(encoding="utf-8")))
    text = json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
    assert '"mystnb"' in text
    file.write_text(text.replace("import time", "import  time"), encoding="utf-8")
    subprocess.run([sys.executable, "-m", "ruff", "format", "-q", file], check=True)
    assert file.read_text(encoding="utf-8") == text
