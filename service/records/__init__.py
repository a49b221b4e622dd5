"""Records of a loop: exports that were uploaded, and the samples they hold."""
