"""Frames from radiosity fields: meshes without cracks, OpenGL passes, tone mapping, image formats."""
