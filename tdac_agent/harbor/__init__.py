"""Task folders for Harbor, and the judge that they contain."""
