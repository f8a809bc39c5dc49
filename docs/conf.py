"""How Sphinx builds the site: see tools/build_site.py, which brings the pages together and calls it."""

from __future__ import annotations

from typing import Any

from pygments.lexers.special import TextLexer

import drivebus

project = "drivebus"
author = "The drivebus authors"
version = release = drivebus.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["conf.py"]

myst_heading_anchors = 4
highlight_language = "text"
# Two dashes are the beginning of an option.
smartquotes = False
# Docstrings quote code by one backtick, as Markdown does.
default_role = "code"
napoleon_use_ivar = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"

html_theme = "furo"
html_title = f"drivebus {version}"
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False


def keep_colons(*told: Any) -> None:
    """A property's docstring is a sentence: what stands before a colon is no type."""
    _, what, *_, lines = told
    if what == "property" and lines:
        lines.insert(0, "\\ ")


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_lexer("csv", TextLexer)
    # Before Napoleon, which has the usual place.
    app.connect("autodoc-process-docstring", keep_colons, priority=400)
