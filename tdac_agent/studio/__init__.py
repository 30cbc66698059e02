"""A page in the browser for everything that the command line does."""
