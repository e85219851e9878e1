"""Optical inspection: where, and by how much, a real part differs from its CAD model, and how sure we are."""

__version__ = "0.1.0"
