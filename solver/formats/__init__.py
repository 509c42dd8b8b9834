"""Files that others make and read: scenes out of them, and scenes and solutions as them."""
