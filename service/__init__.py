"""The HTTP service: routes, wire schemas, session hosting. It translates, and decides nothing about light."""
