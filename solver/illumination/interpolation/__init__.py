"""Quadratics over triangles: their samples, their errors, and the order in which they are built."""
