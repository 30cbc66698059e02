"""The loop that writes, verifies and repairs a controller."""
