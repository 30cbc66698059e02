"""TDAC-EPuck-v0: prisms → contact → infra-red → ground → paths → task → env."""
