"""From a controller, a task and a suite to a report."""
