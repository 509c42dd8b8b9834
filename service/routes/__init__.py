"""The routes of the wire contract, a file for each kind of call."""
