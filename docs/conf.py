"""How Sphinx builds the site from the pages of this folder: `make docs`."""

from pathlib import Path
import sys

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

project = 'lip_id_ros'
author = 'the lip_id_ros authors'
copyright = f'2026 {author}'
extensions = ['myst_nb', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
exclude_patterns = ['_build']
html_theme = 'furo'
html_title = project

myst_enable_extensions = ['dollarmath']
myst_heading_anchors = 4  # as links on GitHub have them

nb_execution_mode = 'force'  # tutorials show what the code of today prints
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 1800
nb_output_stderr = 'remove'  # progress

autodoc_typehints = 'description'
autodoc_member_order = 'bysource'


def setup(app: Sphinx) -> None:
    """Show diagrams, which GitHub draws, as their text."""
    app.add_lexer('mermaid', TextLexer)
