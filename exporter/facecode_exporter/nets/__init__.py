"""The trained networks, with the public checkpoints' parameter names as attribute names."""
