"""Side-by-side measurements, `python -m benchmarks NAME`: figures in results/, what lost in README.md."""
