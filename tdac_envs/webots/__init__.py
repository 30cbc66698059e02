"""Webots controllers in our worlds: the `controller` module, and who answers it.

`controller` is the package that a controller imports, in a process of its own;
`server.StepServer` holds the environment and takes the steps.
"""
