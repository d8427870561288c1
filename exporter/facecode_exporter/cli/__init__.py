"""`facecode-export`: the command lines, thin over the library."""

from facecode_exporter.cli.main import main

__all__ = ["main"]
