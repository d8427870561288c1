"""The page that shows a head: what `html.py` puts together, as files of their own kind."""
