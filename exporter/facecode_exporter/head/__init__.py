"""The demo head: mesh, colours, face units and its division into parts."""
