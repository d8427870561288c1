"""glTF 2.0 as facecode writes it: the binary container, and a document that grows."""
