"""`python -m sleepcast` is the command `sleepcast`."""

import sys

from sleepcast.cli import main

if __name__ == "__main__":
    sys.exit(main())
