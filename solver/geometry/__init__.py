"""Polygons, materials, the immutable scene and its flattening into patches."""
