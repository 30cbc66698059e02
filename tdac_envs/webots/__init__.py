"""Runs Webots controllers in simulated worlds: `controller` module and step server.

A controller runs in its own process and imports the package `controller`;
`server.StepServer` steps the environment.
"""
