"""What tests share: decks, independent solutions, folders. On the path by pyproject.toml."""
