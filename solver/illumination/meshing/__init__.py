"""Leaves cut into conforming triangles along discontinuities."""
