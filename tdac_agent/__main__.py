"""Entry point of the `tdac` script, and of `python -m tdac_agent`."""

import gc
import sys


def main() -> None:
    """The command line; Ctrl-C while that is still being loaded is a line as well."""
    try:
        # What is loaded stays: nothing of it is worth collecting.
        gc.disable()
        from tdac_agent.cli.main import main as command_line

        gc.freeze()
        gc.enable()
        command_line()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
