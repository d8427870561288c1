"""A corpus of recordings, animated by several processes or a cluster, and resumable."""
