"""How motion is measured; knows nothing of training, data sets or files."""
