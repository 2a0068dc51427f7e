"""Products: written all or none, tables as text, and their records."""

import json
import re
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from tbdcore.repro import paths, products


def content(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_failing_write_leaves_the_old_files(tmp_path):
    products.write(tmp_path, {"a.csv": b"old a", "b.csv": b"old b"})
    with pytest.raises(TypeError):  # the second cannot be written: the first must stay
        products.write(tmp_path, {"a.csv": b"new a", "b.csv": object()})
    assert content(tmp_path) == {"a.csv": b"old a", "b.csv": b"old b"}


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OSError, match="file"):
        products.write(tmp_path / "file" / "toy", {"a.csv": b""})


def test_a_signal_waits_until_all_files_are_in_place(tmp_path, monkeypatch):
    """And one that was ignored before, as by nohup, stays ignored."""
    replace = products.os.replace

    def interrupted(part, place):
        signal.raise_signal(signal.SIGINT)
        replace(part, place)

    monkeypatch.setattr(products.os, "replace", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            products.write(tmp_path, {"a": b"1", "b": b"2"})
        assert content(tmp_path) == {"a": b"1", "b": b"2"}
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        products.write(tmp_path, {"a": b"3"})
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


def test_the_products_module_loads_no_matplotlib():
    names = "tbdcore.repro.products, tbdcore.repro.claims"
    code = f"import sys, {names}; print('matplotlib' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n"


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"id": 1}', "\x00"])
def test_a_damaged_record_is_named(tmp_path, text):
    (tmp_path / "fig1.json").write_text(text)
    with pytest.raises(ValueError, match=r"fig1\.json: damaged; delete it, then make") as caught:
        products.record(tmp_path / "fig1.json")
    assert "\n" not in str(caught.value)


# Tables --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [None, "filter"])
def test_a_table_keeps_the_names_of_its_rows(name):
    frame = pd.DataFrame({"x": [1.5, 2.0]}, index=pd.Index(["a_1", "b"], name=name))
    files = products.table_files(frame, "table1", "toy/table1")
    csv, md, tex = (files[f"table1.{end}"].decode() for end in ("csv", "md", "tex"))
    assert csv.splitlines() == [f"{name or ''},x", "a_1,1.5", "b,2"]
    assert md.splitlines()[0] == "<!-- toy/table1 -->"
    assert md.splitlines()[2:] == [
        f"| {name or ''} | x |",
        "| --- | --- |",
        "| a_1 | 1.5 |",
        "| b | 2 |",
    ]
    assert tex.startswith("% toy/table1\n\\begin{tabular}{lr}")
    assert r"$a_{\mathrm{1}}$ & 1.5 \\" in tex


def test_numbers_are_written_with_six_digits():
    frame = pd.DataFrame({"x": [1 / 3, 2e-9, np.nan, 123456.7]})
    assert products.csv(frame) == b'x\n0.333333\n2e-09\n""\n123457\n'
    assert products.markdown(frame) == "| x |\n| --- |\n| 0.333333 |\n| 2e-09 |\n|  |\n| 123457 |\n"


def test_markdown_escapes_what_would_break_the_table():
    frame = pd.DataFrame({"|x|": ["a|b"]})
    assert products.markdown(frame) == "| \\|x\\| |\n| --- |\n| a\\|b |\n"


def test_latex_escapes_text_and_sets_mathematics():
    rows = [r"$P_D^2$ of a_bcde #1", r"\ ~ ^ { } $", "P_d at R_T = 3", "0.5 ± 0.1"]
    text = products.latex(pd.DataFrame({"50 % & more": rows}))
    assert text.splitlines() == [
        r"\begin{tabular}{l}",
        r"\toprule",
        r"50 \% \& more \\",
        r"\midrule",
        r"$P_D^2$ of a\_bcde \#1 \\",
        r"\textbackslash{} \textasciitilde{} \textasciicircum{} \{ \} \$ \\",
        r"$P_{\mathrm{d}}$ at $R_{\mathrm{T}}$ = 3 \\",
        r"0.5 \ensuremath{\pm} 0.1 \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


def test_columns_of_numbers_are_aligned_to_the_right():
    frame = pd.DataFrame({"name": ["a", "b"], "x": [1.0, np.nan], "y": ["0.5 ± 0.1", "-2"]})
    assert products.latex(frame).startswith(r"\begin{tabular}{lrr}")


@pytest.mark.parametrize(
    ("header", "column", "head"),
    [
        ("error, m", 1.0, "error, m"),
        ("mean error, m", 1.0, r"\shortstack[r]{mean \\ error, m}"),
        ("mean error, m", "a longer text", "mean error, m"),
        ("all of the words of a head", "text", r"\shortstack[l]{all of \\ the words \\ of a head}"),
        ("$a$ of all the words", 1.0, "$a$ of all the words"),
    ],
)
def test_a_header_wider_than_its_column_is_broken(header, column, head):
    """A column is nine letters wide at least; mathematics stays whole."""
    text = products.latex(pd.DataFrame({header: [column]}))
    assert text.splitlines()[2] == rf"{head} \\"


@pytest.mark.parametrize(("letters", "form"), [(34, "{l}"), (35, "{p{13em}}")])
def test_a_column_of_more_than_34_letters_is_broken(letters, form):
    frame = pd.DataFrame({"text": [("words " * 6)[: letters - 1] + "x"]})
    assert products.latex(frame).startswith(rf"\begin{{tabular}}{form}")


def test_letters_that_pdftex_cannot_set_become_mathematics():
    assert products.tex("λ ≤ 2 & $λ$") == r"\ensuremath{\lambda} \ensuremath{\le} 2 \& $λ$"


def test_a_named_index_is_a_column():
    frame = pd.DataFrame({"value": [1, 2]}, index=pd.Index(["a", "b"], name="case"))
    assert products.markdown(frame).splitlines()[0] == "| case | value |"
    assert products.latex(frame).splitlines()[2] == r"case & value \\"


def test_every_committed_record_is_whole():
    records = sorted(paths.products().glob("*/*.json"))
    assert records
    for file in records:
        assert products.record(file)["id"] == f"{file.parent.name}/{file.stem}"
        assert re.fullmatch("[0-9a-f]{16}", json.loads(file.read_text())["digest"])
