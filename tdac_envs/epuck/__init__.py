"""The environment TDAC-EPuck-v0: an e-puck in a Webots world."""
