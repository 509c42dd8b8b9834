"""Lightmaps: where in a picture each place on the surfaces has its light ([K 4.3], illumination maps)."""
