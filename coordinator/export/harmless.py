"""Text for a terminal, which obeys some characters."""


def harmless(line: str) -> str:
    """One line without what a file's name could make a terminal do."""
    return "".join(char if char.isprintable() else "\ufffd" for char in line)
