"""Webots controllers in the sandbox."""
