"""Packages for everything that differs between the environments."""
