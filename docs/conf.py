"""How Sphinx builds the site: see tools/build_site.py, which brings the pages together and calls it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pygments.lexers.special import TextLexer
from sphinx.search.en import SearchEnglish

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
# No page leads to an index of all names: the search finds them.
html_use_index = False
html_domain_indices = False
# Written by tools/build_site.py: pages for users come before the reference, and that before pages for developers.
html_search_scorer = str(Path(__file__).with_name("scorer.js"))


class CodesAsWords(SearchEnglish):
    """English, with codes such as `E.oC`, `P00.11` and `b1-01` as words of their own, besides their parts."""

    code = re.compile(r"\w+(?:[.-]\w+)+")
    # A code that no page has is searched for by its parts.
    js_splitter_code = r"""
var splitQuery = (query) =>
  (query.match(/[\p{Letter}\p{Number}_]+(?:[.-][\p{Letter}\p{Number}_]+)*/gu) || []).flatMap((word) => {
    const stemmed = new Stemmer().stemWord(word.toLowerCase());
    const isKnown = [Search._index.terms, Search._index.titleterms].some((terms) => Object.hasOwn(terms, stemmed));
    return isKnown ? [word] : word.split(/[.-]/);
  });
"""

    def split(self, text: str) -> list[str]:
        """The words of a text."""
        return super().split(text) + self.code.findall(text)


def keep_colons(*told: Any) -> None:
    """A property's docstring is a sentence: what stands before a colon is no type."""
    _, what, *_, lines = told
    if what == "property" and lines:
        lines.insert(0, "\\ ")


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_lexer("csv", TextLexer)
    app.add_search_language(CodesAsWords)
    # Before Napoleon, which has the usual place.
    app.connect("autodoc-process-docstring", keep_colons, priority=400)
