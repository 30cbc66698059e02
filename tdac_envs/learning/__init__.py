"""Observation wrappers, guidance and Stable-Baselines3 batches for learning."""
