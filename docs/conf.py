# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""The documentation site: the Markdown that is read in the repository too, as pages (`make docs`).

The root of the repository is the source folder, so that links between pages, and from pages to
code, are the same in both.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ElementTree.parse(ROOT / "package.xml").getroot()

NAVIGATION = {
    "Tutorials": [
        "docs/tutorials/first_mission",
        "docs/tutorials/your_planner",
        "docs/tutorials/cpp_planner",
        "docs/tutorials/training",
        "docs/tutorials/flying",
        "docs/tutorials/kayak",
        "docs/tutorials/live_search",
    ],
    "Guides": [
        "docs/install",
        "docs/python",
        "docs/ros",
        "docs/belief",
        "docs/planners",
        "docs/results",
        "docs/plan_search",
        "docs/operate",
        "docs/security",
        "docs/dashboard",
        "docs/live",
        "docs/recording",
        "docs/report",
        "docs/gis",
        "docs/viewers",
        "docs/coming_from_dsse",
        "docs/campaign",
        "docs/troubleshooting",
    ],
    "Reference": [
        "docs/words",
        "docs/frames",
        "docs/topics",
        "docs/parameters",
        "docs/rules",
        "docs/profiles",
        "docs/sensors",
        "docs/drift",
        "docs/leeway",
        "docs/flight",
        "docs/flights",
        "docs/faults",
        "docs/api",
    ],
    "Project": [
        "docs/speed",
        "docs/architecture",
        "CONTRIBUTING",
        "SECURITY",
        "QUALITY_DECLARATION",
        "CHANGELOG",
        "benchmarks/README",
        "test/oracles/README",
    ],
}
"""Every page but the first one, in the order of the side bar."""

project = MANIFEST.findtext("name")
release = version = MANIFEST.findtext("version")
author = MANIFEST.findtext("maintainer")
copyright = f"{author}, Apache-2.0"

root_doc = "docs/index"
include_patterns = [
    f"{page}.{kind}" for pages in NAVIGATION.values() for page in pages for kind in ("md", "rst")
] + ["docs/index.md"]
# Only what may hold pages is walked through.
exclude_patterns = [
    ".*",
    "build",
    "dist",
    "docs/_build",
    "env",
    "install",
    "log",
    "missions",
    "out",
]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
templates_path = ["_templates"]

# As many levels as the pages have, so that links lead to headings as they do in a repository.
myst_heading_anchors = 4
# Output is not for copying.
copybutton_selector = "div:not(.highlight-text) > div.highlight pre"
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_format = "short"
napoleon_use_ivar = True
python_use_unqualified_type_names = True

html_theme = "furo"
html_title = f"{project} {version}"
html_copy_source = False
html_show_sourcelink = False
# The first page lies in `docs`.
html_additional_pages = {"index": "to_first_page.html"}
html_static_path = ["_static"]
html_css_files = ["copy_buttons.css"]
html_js_files = ["accessible.js"]


def add_navigation(app: Sphinx, page: str, source: list[str]) -> None:
    """Append the tables of contents to the first page, where a repository would show their text."""
    if page == root_doc:
        for caption, pages in NAVIGATION.items():
            entries = "\n".join(f"/{name}" for name in pages)
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```\n"


def unlink_folders(app: Sphinx, page: nodes.document) -> None:
    """Show links to folders of the repository as their text: the site has no such pages."""
    here = (ROOT / app.env.docname).parent
    for link in list(page.findall(addnodes.pending_xref)):
        if link["reftype"] == "myst" and (here / link["reftarget"]).is_dir():
            link.replace_self(link.children)


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("source-read", add_navigation)
    app.connect("doctree-read", unlink_folders)
