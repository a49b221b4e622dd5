"""Indices of control-loop performance from routine data."""
