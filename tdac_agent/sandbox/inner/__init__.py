"""Code that runs in the sandboxed child.

It needs only the standard library and numpy and imports nothing else of tdac, so that
the child sees only these files of the package. The judge imports the modules of the
wire format too, so that both sides use the same code.
"""
