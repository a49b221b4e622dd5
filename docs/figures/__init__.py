"""Figures of the documentation, drawn by scripts from the product's own numbers."""
