"""Providers without a language model: `builtin` and `scripted`."""
