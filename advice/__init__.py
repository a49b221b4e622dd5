"""The walk from a record to an answer, written once for every caller."""
