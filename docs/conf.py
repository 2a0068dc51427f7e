"""Settings of Sphinx for the book, which ``book.py`` builds."""

import inspect
import io
import re
import textwrap
from importlib.util import find_spec
from pathlib import Path

from docutils.core import publish_doctree

from tbdcore.repro import clone

project = "tbdcore"
author = "the tbdcore authors"
copyright = "the tbdcore authors, CC BY 4.0"
html_title = "Five radar papers"

extensions = ["myst_nb", "sphinx.ext.autodoc"]
exclude_patterns = ["docs/README.md", "figures/[!R]*", "notebooks/*.md"]
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "dollarmath"]
nb_execution_mode = "off"
nb_merge_streams = True
nb_render_markdown_format = "myst"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
add_module_names = False

known = clone.find()  # where the book's sources are, if git knows it
html_theme = "sphinx_book_theme"
html_theme_options = {
    "navbar_persistent": [],
    "use_download_button": False,
    "use_fullscreen_button": False,
    "repository_url": known.address,
    "use_repository_button": bool(known.address),
}
html_context = {"default_mode": "light"}
html_static_path = [
    "_static",
    str(Path(find_spec("sphinx-mathjax-offline").origin).parent / "static"),
]
mathjax_path = "mathjax/tex-chtml.js"
html_css_files, html_js_files = ["book.css"], ["book.js"]
html_show_search_summary = False  # it would fetch other pages, which a browser forbids on a disk
html_copy_source = False


def with_rules(app, what, name, obj, options, signature, return_annotation):
    """The signature as help() shows it: for each argument its rule."""
    if what == "function":
        arguments, arrow, returned = str(inspect.signature(obj)).partition(" -> ")
        return arguments, returned or None


def as_written(app, what, name, obj, options, lines):
    """Show a docstring's paragraphs; as they are written where spaces count or RST fails."""
    shown = []
    for text in re.sub(r":\w+:(?=`)", "", "\n".join(lines)).rstrip().split("\n\n"):
        said = io.StringIO()
        publish_doctree(text, settings_overrides={"warning_stream": said})
        if said.getvalue() or re.search(r"^ ", text, re.MULTILINE):
            text = ".. code-block:: text\n\n" + textwrap.indent(text, "   ")
        shown += [*text.split("\n"), ""]
    lines[:] = shown


def setup(app):
    app.connect("autodoc-process-signature", with_rules)
    app.connect("autodoc-process-docstring", as_written)
