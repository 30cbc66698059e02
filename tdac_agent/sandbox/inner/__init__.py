"""Code that runs in the sandboxed child.

It needs only the standard library and numpy and imports nothing of tdac, so that the
child sees these files and no others of the package. The judge imports `wire` too:
both sides speak through the same file.
"""
