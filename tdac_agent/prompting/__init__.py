"""Prompts, answers, feedback and repair rules."""
