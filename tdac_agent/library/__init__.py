"""What a folder has: runs, trainings, campaigns, benches."""
