"""Code shared by both robots: poses, motion, steps, rewards, batches."""
