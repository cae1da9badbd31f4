"""What a task does: load, one pure call, store. No stage knows of the queue."""
