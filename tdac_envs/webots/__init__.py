"""Runs Webots controllers in simulated worlds: `controller` module and step server.

A controller imports the package `controller` in a process of its own;
`server.StepServer` holds the environment and takes the steps.
"""
