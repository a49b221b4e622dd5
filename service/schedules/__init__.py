"""Schedules of settings over operating points; nothing is stored."""
