"""Who sees whom: Embree rays, shafts with their blockers, and the brute-force twin."""
