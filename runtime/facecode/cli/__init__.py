"""`facecode`: the command line, thin over the library."""

from facecode.cli.main import main

__all__ = ["main"]
