"""A printed number stands in the claims file alone: no page's code has a copy of it."""

import ast
import re

import pytest
import tiny

from tbdcore.repro import claims, pages

# Numbers that a page still has; each one goes when the page reads it from its claims file
KNOWN: dict[str, set] = {}
DIGITS = 3  # a printed number with fewer is no sure sign of a copy
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\d)")


def printed(paper):
    """The numbers that a paper prints with at least three digits."""
    numbers = set()
    for claim in claims.read(paper).values():
        digits = re.sub(r"\D", "", claim.value).lstrip("0")
        if claim.kind == "number" and len(digits) >= DIGITS:
            numbers.add(abs(claims.parse(claim.value)[0]))
    return numbers


def copies(paper):
    """The printed numbers of a paper that stand in the code of its page, as numbers or in texts."""
    wanted, found = printed(paper), set()
    for cell in pages.cells(paper):
        for node in ast.walk(ast.parse(re.sub(r"(?m)^[%!].*\n?", "", cell))):
            value = getattr(node, "value", None) if isinstance(node, ast.Constant) else None
            if isinstance(value, str):
                found |= {float(text) for text in NUMBER.findall(value)}
            elif isinstance(value, int | float):
                found.add(abs(value))
    return wanted & found


@pytest.mark.parametrize("paper", claims.papers())
def test_no_code_of_a_page_has_a_printed_number_as_a_literal(paper):
    assert copies(paper) == KNOWN.get(paper, set())


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("x = 14.11", {14.11}),
        ("x = [1.0, -14.11]", {14.11}),
        ('x = "transmitted power that 14.11 dB save"', {14.11}),
        ('x = f"{y:.2f}; published: 14.11"', {14.11}),
        ("x = 14.1 + 114.11", set()),
        ('x = "figure 14.1, v14.11.2"', set()),
    ],
)
def test_a_copy_is_found(repository, code, found):
    (repository / "data" / "claims" / "tiny.csv").write_text(
        tiny.CLAIMS.replace(",0.0,", ",14.11,")
    )
    tiny.change(repository, trials=code)
    assert copies("tiny") == found
