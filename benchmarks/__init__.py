"""Side-by-side measurements: `python -m benchmarks NAME`; results are kept in results/, what lost stands in README.md."""
