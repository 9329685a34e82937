"""`python -m deeplight` is the `deeplight` command."""

import sys

from deeplight.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
