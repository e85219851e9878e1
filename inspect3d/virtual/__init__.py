"""A virtual rig: parts with known defects and the instruments that measure them."""
