"""What differs between the environments: a room for each."""
