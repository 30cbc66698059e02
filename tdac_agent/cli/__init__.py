"""The command line: one module per command, another for its flags."""
