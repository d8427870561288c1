"""`facecode bench`: latency per frame on this machine."""
