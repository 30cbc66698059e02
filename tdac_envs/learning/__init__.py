"""For learning: observation wrappers, guidance, batches for Stable-Baselines3."""
