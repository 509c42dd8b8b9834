"""What edits do to a solution: which links they touch, and the energy that moves ([G])."""
