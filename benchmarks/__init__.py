"""Figures on real images, run by hand: `make bench`, or `python -m benchmarks NAME`."""
