"""``python -m tbdcore``: the command line, without modules of the current folder."""

import sys

if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the current folder
    from tbdcore.repro.cli import main

    sys.exit(main())
