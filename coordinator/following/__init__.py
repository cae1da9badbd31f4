"""Sending orders to the workers, and hearing what came of them."""
