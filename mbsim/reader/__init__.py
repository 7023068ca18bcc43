"""Decks in XML to a checked `Model`: the only place that knows tags and spellings."""
