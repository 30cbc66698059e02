"""Generators of static worlds; `registry.GENERATORS` lists them."""
