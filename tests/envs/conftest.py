"""Beside this file lie the helpers that tests of several rooms import."""
