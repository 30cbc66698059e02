"""Runs Webots controllers in the sandbox."""
