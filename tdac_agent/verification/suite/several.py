"""Independent assertions of one test, of which all that fail are reported."""

from __future__ import annotations

from types import TracebackType

MAX_REPORTED = 4


class Several:
    """Collects failed assertions.

    An assertion that fails inside `with several:` ends that block alone; `settle()`
    raises one `AssertionError` with the messages of all of them.
    """

    def __init__(self) -> None:
        self._messages: list[str] = []

    def __enter__(self) -> None:
        """Begins an independent part of the test."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> bool:
        if not isinstance(error, AssertionError):
            return False
        # pytest may append the values of the expression to the message.
        self._messages.append(str(error).partition("\nassert ")[0])
        return True

    def settle(self) -> None:
        """Raises what was collected.

        Raises:
            AssertionError: An assertion failed; repeated messages are given once.
        """
        messages = list(dict.fromkeys(self._messages))
        more = len(messages) - MAX_REPORTED
        shown = messages[:MAX_REPORTED] + ([f"and {more} more"] if more > 0 else [])
        if shown:
            raise AssertionError("; ".join(shown))
