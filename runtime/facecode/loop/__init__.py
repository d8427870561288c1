"""The step loop: speech and a request to codes and motion, frame by frame."""
