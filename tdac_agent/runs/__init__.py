"""Runs on disk: written, read, resumed, replayed."""
