# Sphinx configuration of the documentation site; toolchain/site runs Sphinx with it. Everything that a page needs (style,
# search index) is in the site: no font, script or picture is fetched from elsewhere.
import os

project = "haptic"
version = release = os.environ["HAPTIC_VERSION"]
author = "the haptic project"
project_copyright = "MIT licence"

extensions = ["myst_parser", "breathe"]
source_suffix = {".md": "markdown"}
root_doc = "index"
exclude_patterns = ["site"]

# Headings of three levels can be the target of a link, named as code hosts name them: #cost-of-viewers.
myst_heading_anchors = 3

breathe_projects = {"haptic": os.environ["HAPTIC_DOXYGEN_XML"]}
breathe_default_project = "haptic"
breathe_domain_by_extension = {"h": "c"}

# The examples of the pages are commands and files; the words in them are no keywords of a language.
highlight_language = "none"

html_theme = "furo"
html_title = f"haptic {version}"
html_static_path = [os.environ["HAPTIC_SITE_STYLE"]]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False


def setup(app):
    from pygments.lexers.special import TextLexer

    # The tables of folders and their allowed includes, which tests/structure reads.
    app.add_lexer("folders", TextLexer)
