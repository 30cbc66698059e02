"""Checkpoints of one's own are loaded without a question, others' are not."""

import pytest

from tdac_agent.tasks.trust import NotTrustedError
from tdac_agent.training import checkpoint_marks
from tdac_envs.core.intake import RECORD_BYTES


def test_steps_to_learn_from_again_may_be_large(tmp_path):
    """SAC keeps a million of them: more than any file that is read of a run."""
    draft, file = tmp_path / "draft", tmp_path / checkpoint_marks.REPLAY
    with draft.open("wb") as content:
        content.truncate(2 * RECORD_BYTES)
    checkpoint_marks.install_checkpoint(draft, file)
    checkpoint_marks.check(tmp_path, trust=False)
    with file.open("r+b") as content:
        content.write(b"another")
    with pytest.raises(NotTrustedError, match=r"replay\.pkl, which can run any code"):
        checkpoint_marks.check(tmp_path, trust=False)
