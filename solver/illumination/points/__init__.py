"""Irradiance at points: what a point sees of every source, exactly."""
