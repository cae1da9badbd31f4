"""The foreman: survey -> shards -> tasks -> one committed index; and the command line."""
