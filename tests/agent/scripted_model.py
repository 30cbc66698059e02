"""A program that answers as a model would, from prepared files, one after the other.

    python scripted_model.py FOLDER < prompt > reply

FOLDER holds `reply-1.md`, `reply-2.md`, ...; each prompt is kept as `prompt-N.md`.
"""

import sys
from pathlib import Path

folder = Path(sys.argv[1])
number = len(list(folder.glob("prompt-*.md"))) + 1
prompt = sys.stdin.buffer.read()
(folder / f"prompt-{number}.md").write_bytes(prompt)
sys.stdout.buffer.write((folder / f"reply-{number}.md").read_bytes())
