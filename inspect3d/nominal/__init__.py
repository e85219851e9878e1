"""Stage 1, the part as designed."""
