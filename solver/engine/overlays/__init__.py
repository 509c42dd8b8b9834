"""Visualizations of a session's insides, as data ([H B.4]): one module each, over a common base."""
