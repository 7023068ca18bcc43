"""Adams solver decks (.adm) to a draft: their statements are read as the XML's are."""
