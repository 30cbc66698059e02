"""tdac's tasks and levels as tasks of Inspect (package `inspect_ai`).

Only the entry point `inspect_ai` imports the modules that need Inspect.
"""
