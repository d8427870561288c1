"""Training as in the CodeTalker paper: a motion prior (stage 1), then speech to codes (stage 2)."""
