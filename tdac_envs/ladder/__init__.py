"""Generated worlds that are new to a controller, its author and its training."""
