"""Illumination maps ([K 4.3]): irradiance of all surfaces in a picture, by virtual lights or a solution."""
