"""glTF 2.0: scenes read out of it, and written as it."""
