"""``python -m tbdcore``: the command line, without modules of the current folder."""

import sys

if __name__ == "__main__":
    del sys.path[: not sys.flags.safe_path]  # the current folder comes first, if at all
    from tbdcore.repro.cli import main

    sys.exit(main())
