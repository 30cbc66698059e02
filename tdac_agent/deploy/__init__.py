"""Verified controllers where they are to run: a project of Webots."""
