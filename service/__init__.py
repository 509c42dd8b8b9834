"""The HTTP service: routes, wire schemas and session hosting. It translates, and decides nothing about light."""
