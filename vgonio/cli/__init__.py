"""The command line `vgonio`. Importing it loads nothing heavy, so that --help is instant."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 our own fault, 2 bad usage or input, 130 interrupted."""
    try:
        from .outcome import run

        return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        print("vgonio: interrupted", file=sys.stderr)
        return 130
