"""Stage 4, how far the part is from its CAD model, node by node."""
