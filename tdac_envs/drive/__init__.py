"""What both robots share: poses, motion, steps, rewards, batches."""
