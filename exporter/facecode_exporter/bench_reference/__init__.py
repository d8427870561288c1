"""The public algorithm in PyTorch timed beside the runtime."""
