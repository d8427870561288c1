"""Pictures of a face in numpy alone: no display, no GPU, no graphics library."""
