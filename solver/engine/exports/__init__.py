"""Scenes and their solutions as files for other programs."""
