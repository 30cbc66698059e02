"""The arena: entrants of every kind on the same worlds of task sets.

`entrants` finds what the user names, `bench` has it driven, `jobs` distributes it over
processes, `record` is the results file, `compared` its statistics. Public are `merged`,
which reads results, and `frame_of`, which makes a table of them.
"""

from tdac_agent.bench.figures import frame_of
from tdac_agent.bench.shown import merged

__all__ = ["frame_of", "merged"]
