"""`tdac report`: runs as one self-contained HTML file."""

from tdac_agent.html_report.page import Page, make_page

__all__ = ["Page", "make_page"]
