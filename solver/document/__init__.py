"""The contract's scene document and the sample scenes that ship with the package."""
