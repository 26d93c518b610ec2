"""The command line of a program that is chosen by an environment variable, part by part."""

import argparse
import os
from collections.abc import Collection


def choose(variable: str, parts: Collection[str], description: str | None) -> list[str]:
    """Names in `variable`, separated by commas; all parts without it.

    Ends the program: after `--help`, and with 2 at an argument or a part that there is not.
    """
    parser = argparse.ArgumentParser(
        prog=f"{variable}=PART,... make {variable.lower()}",
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=f"parts: {', '.join(parts)}",
    )
    parser.parse_args()
    chosen = [name for name in os.environ.get(variable, "").split(",") if name]
    unknown = [name for name in chosen if name not in parts]
    if unknown:
        parser.error(f"there is no {', '.join(unknown)}; there are {', '.join(parts)}")
    return chosen or list(parts)
