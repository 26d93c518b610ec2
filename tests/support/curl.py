"""Stands in for curl where the machine has none: the few flags that the tutorial uses."""

import argparse
import sys
from pathlib import Path

import requests


def main() -> int:
    """Make the request and print the answer's body."""
    parser = argparse.ArgumentParser(prog="curl")
    parser.add_argument("-s", "-sS", action="store_true")
    parser.add_argument("-X", dest="method", default="GET")
    parser.add_argument("-H", dest="headers", action="append", default=[])
    parser.add_argument("-d", dest="data")
    parser.add_argument("url")
    arguments = parser.parse_args()
    data = arguments.data
    if data is not None and data.startswith("@"):
        data = Path(data[1:]).read_text(encoding="utf-8")
    answer = requests.request(
        arguments.method,
        arguments.url,
        headers=dict(header.split(": ", 1) for header in arguments.headers),
        data=data,
        timeout=30,
    )
    sys.stdout.write(answer.text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
