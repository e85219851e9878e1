"""Mesh-based stereocorrelation: the shape of a speckled part from pictures of it, in the frame of its CAD model.

After L. Dubreuil, J.-E. Dufour, Y. Quinsat, F. Hild, "Mesh-Based Shape Measurements with Stereocorrelation: Principle
and First Results", Experimental Mechanics 56, 2016; equation numbers in this package are the paper's.
"""
