"""Stage 3, where the measured points lie in the CAD frame."""
