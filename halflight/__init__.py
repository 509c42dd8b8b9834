"""The command line: serve, warm, render, info."""
