"""Static contract (Table I): compliance and hygiene, read from the source alone."""

from tdac_agent.verification.suite.every_task import (  # noqa: F401, I001 - they run in this order
    test_source_parses,
    test_imports,
    test_policy_is_defined,
    test_constants,
    test_entry_points,
    test_main,
    test_hygiene,
)
