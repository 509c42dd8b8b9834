"""Sessions in worker processes: the protocol, the process itself, its far end, the warm pool."""
