"""A page as it reads, without the marks of its terms."""

import re

from tdac_agent.html_report import make_page


def reading(folder):
    """The report on a run, without the marks that explain its terms."""
    return unmarked(make_page(folder).html.decode())


def unmarked(html):
    """A page without the marks that explain its terms."""
    return re.sub(r"</?abbr[^>]*>", "", html)
