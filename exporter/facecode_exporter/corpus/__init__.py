"""The generated corpus: spoken sentences with procedural motion."""
