"""How the documentation is built: ``make docs``. Nothing in it needs a network."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

from besman import __version__

project = "besman"
author = "the besman developers"
copyright = "the besman developers"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "command_line",
    "configuration",
    "docstrings",
    "examples",
    "mathml",
    "packages",
    "rooms",
    "table_of",
    "thesis_tables",
]
exclude_patterns = ["_build", "extensions", "results"]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
default_role = "name"

autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "furo"
html_title = f"besman {version}"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["besman.css"]
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"sidebar_hide_name": False}
highlight_language = "text"
pygments_style = "friendly"
pygments_dark_style = "github-dark"
