"""The site. `make docs` builds it with warnings as errors, without a network."""

from __future__ import annotations

import importlib.metadata
import inspect
import re
from collections.abc import Iterator
from pkgutil import resolve_name
from typing import Any, get_type_hints

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import stringify_annotation

project, author = "tdac", "the tdac authors"
release = importlib.metadata.version("tdac")
# The source folder is that of the repository, so that links between files work on the
# site as they do in the repository.
root_doc = "docs/index"
include_patterns = [
    "docs/**.md",
    "notebooks/*.ipynb",
    "results/**/README.md",
    "results/*/PLAN.md",
    "results/ladder/BEFORE.md",
    "results/mutation*.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
]
exclude_patterns = [".*", "build", "runs", "node_modules"]
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme, html_title = "furo", "tdac"
html_extra_path = ["site"]
html_static_path, html_css_files = ["static"], ["pictures.css"]
# Notebooks are kept with their outputs: `make notebooks` executes them.
nb_execution_mode = "off"
nb_merge_streams = True
myst_heading_anchors = 4
nitpicky = True
# Types of the code, of other packages, and words for shapes, which link nowhere.
nitpick_ignore_regex = [("py:.*", r".*")]
# The page of the API also has what needs this extra, which is large.
autodoc_mock_imports = ["stable_baselines3"]
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
autodoc_member_order = "bysource"
napoleon_use_ivar = True


class Docstring(SphinxDirective):
    """Shows the docstring of an object, which is Markdown: `{docstring} NAME`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes of the docstring."""
        text = inspect.getdoc(resolve_name(self.arguments[0]))
        assert text is not None
        lines = "\n".join(_listed(text.splitlines()))
        return self.parse_text_to_nodes(lines, allow_section_headings=True)


def _listed(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring, with its `Args:` as a list."""
    inside = False
    for line in lines:
        if line == "Args:":
            inside = True
        elif inside and (found := re.match(r"    (\w+): (.*)", line)):
            yield f"- `{found[1]}`: {found[2]}"
        elif inside and line.startswith("        "):
            yield f"  {line.strip()}"
        else:
            inside = inside and not line
            yield line


def as_rst(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Turns the Markdown of a docstring into reStructuredText, for autodoc."""
    del app, what, name, options
    lines += _fields(obj, lines)
    lines[:] = list(
        _tables(re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", line) for line in lines)
    )


def _fields(obj: Any, lines: list[str]) -> list[str]:
    """The fields of a record, with types, as attributes of its docstring."""
    fields = getattr(obj, "model_fields", {})
    if not fields or "Attributes:" in lines:
        return []
    rows = []
    for name, hint in get_type_hints(obj).items():
        if name in fields:
            kind = re.sub(r"[a-z_]\w*\.", "", stringify_annotation(hint))
            rows.append(f"    {name} ({kind}): {fields[name].description or ''}")
    return ["", "Attributes:", *rows, ""]


def _tables(lines: Iterator[str]) -> Iterator[str]:
    """The lines, with tables as `list-table`."""
    rows = 0
    for line in lines:
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if not line.strip().startswith("|"):
            if rows:
                yield ""
            rows = 0
            yield line
        elif not set("".join(cells)) <= set("-: "):
            if not rows:
                yield from ("", ".. list-table::", "   :header-rows: 1", "")
            rows += 1
            for number, cell in enumerate(cells):
                yield f"   {'* - ' if number == 0 else '  - '}{cell}"


def setup(app: Sphinx) -> dict[str, bool]:
    """Adds what this site needs."""
    app.add_directive("docstring", Docstring)
    app.connect("autodoc-process-docstring", as_rst, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
