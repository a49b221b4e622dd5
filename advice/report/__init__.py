"""A tuning case as one self-contained page."""
