"""What `tdac export ros2` copies: the node, and templates of the other files."""
