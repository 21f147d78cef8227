"""The command `kiln`."""

import signal
import sys

from ._kiln import run_command


def main() -> None:
    # The command handles SIGINT itself, and Python is not to raise KeyboardInterrupt for the same signal.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(run_command(sys.argv[1:]))


if __name__ == "__main__":
    main()
