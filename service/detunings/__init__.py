"""Settings by one knob from calm to fast; nothing is stored."""
