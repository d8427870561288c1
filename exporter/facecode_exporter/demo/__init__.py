"""The corpus that the demo model learns from, made from packages anyone can install.

Text, speech, phone times and a procedural mouth: nothing here was captured from a person. It
teaches timing, closures and styles; it does not replace a captured corpus.
"""
