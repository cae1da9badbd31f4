"""Words that every room shares: errors, configuration, records. Imports nothing of ours."""
