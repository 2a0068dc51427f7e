"""Settings of Sphinx for the book, which ``book.py`` builds."""

import importlib
import io
import pkgutil
import re
from importlib.util import find_spec
from pathlib import Path

from docutils.core import publish_doctree

import tbdcore

project = "tbdcore"
author = "the tbdcore authors"
copyright = "the tbdcore authors, CC BY 4.0"
html_title = "Five radar papers, number by number"

extensions = ["myst_nb", "sphinx.ext.autodoc"]
exclude_patterns = ["docs/README.md", "figures/[!R]*", "notebooks/*.md"]
myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "dollarmath"]
nb_execution_mode = "off"
nb_merge_streams = True
nb_render_markdown_format = "myst"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
add_module_names = False

html_theme = "sphinx_book_theme"
html_theme_options = {"use_download_button": False, "use_fullscreen_button": False}
html_static_path = [
    "_static",
    str(Path(find_spec("sphinx-mathjax-offline").origin).parent / "static"),
]
mathjax_path = "mathjax/tex-chtml.js"
html_css_files = ["book.css"]
html_show_search_summary = False  # it would fetch other pages, which a browser forbids on a disk
html_copy_source = False


def show_functions():
    """Put the function behind a kernel in the kernel's place: autodoc knows functions."""
    for module in pkgutil.iter_modules(tbdcore.__path__, "tbdcore."):
        if not module.ispkg:
            names = vars(importlib.import_module(module.name))
            names.update({k: v.py_func for k, v in names.items() if hasattr(v, "py_func")})


def as_written(app, what, name, obj, options, lines):
    """Show a docstring that is no reStructuredText as it is written."""
    said, text = io.StringIO(), re.sub(r":\w+:(?=`)", "", "\n".join(lines))
    publish_doctree(text, settings_overrides={"warning_stream": said})
    if said.getvalue():
        lines[:] = [".. code-block:: text", "", *(f"   {line}" for line in lines)]


def setup(app):
    show_functions()
    app.connect("autodoc-process-docstring", as_written)
