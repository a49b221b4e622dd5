"""The details around settings: scan time, filters, weights; nothing is stored."""
