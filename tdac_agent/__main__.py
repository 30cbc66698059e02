"""Entry point of the `tdac` script and of `python -m tdac_agent`."""

import gc
import sys

from tdac_agent.interpreter import make_safe


def main() -> None:
    """Runs the command line; Ctrl-C during its imports prints one line, too."""
    try:
        # Imported objects live until exit: collecting them is a waste of time.
        gc.disable()
        make_safe()
        from tdac_agent.cli.main import main as command_line

        gc.freeze()
        gc.enable()
        command_line()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
