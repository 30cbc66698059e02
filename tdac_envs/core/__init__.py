"""Shared basics: errors, argument and file checks, extras, compiled code."""
