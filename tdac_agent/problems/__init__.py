"""A task or a level as a question for a model, with the judge of its answers."""
