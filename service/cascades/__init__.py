"""Cascades with their sweep; nothing is stored."""
