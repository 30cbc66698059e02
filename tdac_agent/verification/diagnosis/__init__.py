"""What went wrong in an episode, in words and figures."""
