"""Feed-forward of measured loads; nothing is stored."""
