"""What an index will cost, before any work: a sample is extracted, the rest worked out."""
