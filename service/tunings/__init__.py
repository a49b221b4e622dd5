"""Verified controller settings: for a loop, for a bare process, for many processes at once."""
