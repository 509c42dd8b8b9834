"""Fine light on a coarse solution: point irradiance, discontinuities, and the interpolants that show both."""
