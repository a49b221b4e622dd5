"""Loopwright beside its peers: the same work, in one run, the error printed beside the time."""
