"""The command `kiln`."""

import sys

from ._kiln import run_command


def main() -> None:
    sys.exit(run_command(sys.argv[1:]))


if __name__ == "__main__":
    main()
