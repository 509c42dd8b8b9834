"""Speed against error, measured: `make bench`.

A module holds one measurement: what is measured, the figures that come of it, and their table. Each runs in
a process of its own, so that memory is its own and no measurement warms another. Targets stand beside the
figures, met or not.
"""
