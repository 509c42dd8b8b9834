"""Form factors, the element hierarchy and its links, and the residual-based radiosity solve."""
