"""Evaluates a task with Inspect's mock model, in a process of its own.

    python mock_eval.py REQUEST LOGS

REQUEST is a JSON file: `task`, `answers` of the model, `args` of the task, and
`attempts` of the solver `repair`, if it is used.
"""

import json
import sys

from inspect_ai import eval as evaluate
from inspect_ai.model import ModelOutput, ModelUsage, get_model
from inspect_ai.util import registry_create


def output(text):
    # With a usage, nothing downloads an encoding to count tokens.
    found = ModelOutput.from_content("mockllm/model", text)
    found.usage = ModelUsage(input_tokens=1, output_tokens=1, total_tokens=2)
    return found


def main(request, logs):
    with open(request, encoding="utf-8") as file:
        wanted = json.load(file)
    attempts = wanted.get("attempts")
    solver = None
    if attempts is not None:
        solver = registry_create("solver", "tdac_agent/repair", attempts=attempts)
    answers = [output(text) for text in wanted["answers"]]
    evaluate(
        wanted["task"],
        model=get_model("mockllm/model", custom_outputs=answers),
        task_args=wanted.get("args", {}),
        epochs=1 if solver else len(answers),
        **({"solver": solver} if solver else {}),
        log_dir=logs,
        display="none",
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
