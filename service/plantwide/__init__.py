"""What loops of the plant have in common: shared oscillations, their source, cascades."""
