"""TDAC-EPuck-v0: prisms → contact → infra-red → ground → task → env."""
