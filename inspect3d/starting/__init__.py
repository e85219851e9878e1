"""A start without a click: the cameras before the part, from the pictures alone."""
