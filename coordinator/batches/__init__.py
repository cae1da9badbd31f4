"""Photos to locate by the thousand: where they are listed, named batches, and their answers."""
