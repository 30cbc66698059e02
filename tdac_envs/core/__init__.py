"""Shared basics: errors, argument and file checks, extras, compiled code."""

import contextlib
import os

# numba obeys this file of the working directory, which may be anyone's: where there is
# one, numba is imported from elsewhere. `tdac_envs.core.compiled` keeps it out later.
NUMBA_FILE = ".numba_config.yaml"
if os.path.exists(NUMBA_FILE):
    with contextlib.chdir(os.sep):
        import numba  # noqa: F401
