"""The judge's processes, which run suites and episodes of controllers."""
