"""Repeated tests of stored loops taken together; nothing is stored."""
