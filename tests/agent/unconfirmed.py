"""`synthesize` that ends at `passed`: a confirmation takes a hundred drives."""

from functools import partial

import tdac_agent

synthesize = partial(tdac_agent.synthesize, confirm=False)
