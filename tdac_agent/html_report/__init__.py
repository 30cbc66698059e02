"""Runs as one HTML file that needs nothing else: `tdac report`."""

from tdac_agent.html_report.page import Page, make_page

__all__ = ["Page", "make_page"]
