"""A server for faces that speak while they listen: see docs/serve.md."""
