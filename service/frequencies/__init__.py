"""Frequency tests of stored loops: measured response, model and margins; nothing is stored."""
