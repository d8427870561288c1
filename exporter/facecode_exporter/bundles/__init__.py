"""Trained systems to bundles: graphs, manifest, parity, int8."""
