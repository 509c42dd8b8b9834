"""Speed against error, measured: `make bench`."""
