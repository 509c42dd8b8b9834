"""Instant radiosity as a renderer: blocks of virtual lights, and the frames that they add up to [K]."""
