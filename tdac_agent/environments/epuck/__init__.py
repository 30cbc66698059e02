"""TDAC-EPuck-v0: its tasks, pictures, worlds and export to Webots."""
