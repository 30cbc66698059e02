"""Training of baselines with stable-baselines3, on the tasks of the controllers."""
