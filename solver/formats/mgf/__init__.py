"""MGF, the Materials and Geometry Format of Greg Ward: scenes by physical quantities, as text."""
