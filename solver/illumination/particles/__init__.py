"""The particle side of instant radiosity: low-discrepancy points, and the lights that a walk leaves."""
