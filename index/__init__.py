"""What an index is on disk: generations, segments, codebooks, catalogue, jobs."""
