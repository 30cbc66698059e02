"""The command line: one module per command, and one for its flags."""
