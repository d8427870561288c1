"""How good is the motion? Distances to captured faces, and lip sync that needs no capture."""
