"""What tests, feeds and measures the product, and is not shipped: run with `python -m lab.NAME`."""
