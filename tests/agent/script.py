"""A provider with prepared answers, for tests of the loop."""

from tdac_agent.models.provider import Reply

STILL = "def policy(obs):\n    return 0.0, 0.0\n"
AHEAD = "def policy(obs):\n    return 1.0, 1.0\n"
NO_RULES = Reply("```json\n[]\n```")


def code(source, **reported):
    """An answer with a controller."""
    return Reply(f"Here it is:\n```python\n{source}```\n", **reported)


class Script:
    """A provider that gives prepared answers and remembers what it was asked."""

    name = "script"
    paid = False

    def __init__(self, *answers):
        self.answers = list(answers)
        self.requests = []

    def complete(self, request):
        self.requests.append(request)
        answer = self.answers.pop(0)
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def asked(self):
        return [(r.kind, *r.sample[1:]) for r in self.requests]


class Paid(Script):
    """A script whose answers cost tokens, as many as are reserved."""

    paid = True
