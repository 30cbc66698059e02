"""`tdac mcp`: a server by which coding agents write controllers for tdac.

It speaks the Model Context Protocol. What an agent submits is a candidate of a run, and
is tested in the sandbox like any other.
"""
