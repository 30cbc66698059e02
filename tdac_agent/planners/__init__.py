"""Classical local planners as controllers: their files, and their values."""
